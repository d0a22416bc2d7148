import pytest


@pytest.mark.flake8
@pytest.mark.linter
def test_flake8():
    ament_flake8 = pytest.importorskip(
        'ament_flake8.main', reason='needs ament_flake8: use make test, or rosdep install'
    )
    rc, errors = ament_flake8.main_with_errors(argv=['isotruss_ros', 'test', 'setup.py'])
    assert rc == 0, f'{len(errors)} style errors:\n' + '\n'.join(errors)
