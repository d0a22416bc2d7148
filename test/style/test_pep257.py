import pytest


@pytest.mark.linter
@pytest.mark.pep257
def test_pep257():
    ament_pep257 = pytest.importorskip(
        'ament_pep257.main', reason='needs ament_pep257: use make test, or rosdep install'
    )
    rc = ament_pep257.main(argv=['isotruss_ros', 'test', 'setup.py'])
    assert rc == 0, 'docstrings that differ from PEP 257 are listed above'
