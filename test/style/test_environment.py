# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scripts of `make` that set up the environment, with stand-ins for pip, uv and CMake."""

import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ROOT / 'tools'
#: Writes its arguments, and the files of requirements that they name, to a file.
RECORDED = """#!/bin/sh
echo "{name} $*" >> "{calls}"
for word; do case $word in *.txt|*.new) sed 's/^/  /' "$word" >> "{calls}" ;; esac; done
"""
#: `python -m pip` for which no index has uv, and one that installs it.
NO_UV = 'case "$*" in *uv==*) exit 1 ;; esac\n'
INSTALLS_UV = 'case "$*" in *uv==*) cp "{folder}/uv" "{folder}/venv/bin/uv" ;; esac\n'


def write_command(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


def run(script, *arguments, cwd=ROOT, **environment):
    return subprocess.run(
        ['/bin/sh', script, *map(str, arguments)],
        cwd=cwd,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=60,
    )


def install(folder, pip='', uv='', **environment):
    """Install requirements.txt by stand-ins; return the output, and the calls by their program."""
    calls = folder / 'calls'
    recorded = RECORDED.format(name='{name}', calls=calls)
    write_command(
        folder / 'venv' / 'bin' / 'python',
        recorded.format(name='pip') + pip.format(folder=folder),
    )
    write_command(folder / 'uv', recorded.format(name='uv') + uv)
    done = run(TOOLS / 'install_packages.sh', folder / 'venv', 'requirements.txt', **environment)
    assert done.returncode == 0, done.stderr
    return done.stdout, calls.read_text()


def pins(printed, program):
    """Return the pins that a program was last called with."""
    last = re.findall(rf'^{program} .*\n((?:  .*\n)*)', printed, re.MULTILINE)[-1]
    return re.findall(r'^  ([\w.-]+==\S+)', last, re.MULTILINE)


def test_without_uv_pip_installs_the_same_versions_and_says_so(tmp_path):
    by_uv, by_pip = tmp_path / 'uv', tmp_path / 'pip'
    by_uv.mkdir()
    by_pip.mkdir()
    said, calls = install(by_uv, INSTALLS_UV)
    assert 'pip installs' not in said
    versions = pins(calls, 'uv')
    assert 'numpy' in {pin.split('==')[0] for pin in versions}
    said, calls = install(by_pip, NO_UV)
    assert 'There is no uv here; pip installs the same versions' in said
    assert pins(calls, 'pip') == versions
    assert '\nuv ' not in calls


def test_where_uv_fails_pip_installs_the_same_versions_and_says_so(tmp_path):
    said, calls = install(tmp_path, INSTALLS_UV, 'exit 1\n')
    assert 'uv fails; pip installs the same versions' in said
    assert pins(calls, 'pip') == pins(calls, 'uv') != []


def test_pip_is_chosen_by_a_variable(tmp_path):
    said, calls = install(tmp_path, INSTALLS_UV, INSTALLER='pip')
    assert 'pip installs the packages, as INSTALLER says' in said
    assert pins(calls, 'pip')
    assert 'uv==' not in calls.splitlines()[0]


def test_without_a_network_the_error_says_what_to_do(tmp_path):
    write_command(tmp_path / 'bin' / 'python', '#!/bin/sh\necho no route to host >&2\nexit 1\n')
    done = run(TOOLS / 'install_packages.sh', tmp_path, 'requirements.txt')
    assert done.returncode == 1
    assert 'no route to host' in done.stderr
    assert 'run the same command again once the network answers' in done.stderr


def test_messages_are_built_again_only_if_their_content_changes(tmp_path):
    """In a folder with a space in its name."""
    clone = tmp_path / 'a clone'
    shutil.copytree(ROOT / 'msg_defs', clone / 'msg_defs')
    shutil.copytree(TOOLS, clone / 'tools')
    shutil.copy(ROOT / 'requirements.txt', clone)
    calls = clone / 'calls'
    write_command(clone / '.venv' / 'bin' / 'cmake', f'#!/bin/sh\necho "$1" >> "{calls}"\n')

    def count_builds():
        done = run('tools/build_messages.sh', '.venv', cwd=clone)
        assert done.returncode == 0, done.stderr
        return calls.read_text().split().count('--build')

    message = next((clone / 'msg_defs' / 'msg').glob('*.msg'))
    assert count_builds() == 1
    message.touch()
    assert count_builds() == 1
    message.write_text(message.read_text() + 'float64 one_more\n')
    assert count_builds() == 2
    message.unlink()
    assert count_builds() == 3


def recipe(target):
    """Return the lines of a recipe of the Makefile."""
    text = (ROOT / 'Makefile').read_text()
    return re.search(rf'^{target}:.*\n((?:\t.*\n)+)', text, re.MULTILINE)[1].splitlines()


def test_last_line_of_the_tests_names_the_one_that_is_skipped_without_chromium(tmp_path):
    line = recipe('test')[-1].strip().removeprefix('@')

    def printed():
        command = ['/bin/sh', '-c', line]
        done = subprocess.run(command, env={'PATH': str(tmp_path)}, capture_output=True, text=True)
        return done.stdout

    (name,) = re.findall(r'\btest_\w+', printed())
    assert 'sudo apt install chromium' in printed()
    session = (ROOT / 'test' / 'system' / 'test_browser_session.py').read_text()
    assert f'\ndef {name}(' in session
    write_command(tmp_path / 'chromium', '#!/bin/sh\n')
    assert not printed()


PYTHON = '#!/bin/sh\ncase "$2" in\n*_base_executable*) echo "$0" ;;\n{cases}\n*) exit 0 ;;\nesac\n'
NEWER = PYTHON.format(cases="*implementation*) echo '3.14 CPython' ;;")
WITHOUT_VENV = PYTHON.format(
    cases="*implementation*) echo '3.12 CPython' ;;\n*ensurepip*) exit 1 ;;"
)


@pytest.mark.parametrize(
    ('commands', 'words'),
    [
        ({'python3': None}, "no command 'python3'; install Python 3.10 to 3.13 with: sudo apt"),
        ({'python3': NEWER}, 'is Python 3.14 CPython, and CPython 3.10 to 3.13 is needed'),
        ({'python3': WITHOUT_VENV}, 'sudo apt install python3-venv (or python3.12-venv)'),
        ({'cc': None}, "no compiler ('cc'); install one with: sudo apt install build-essential"),
        ({'c++': None}, "no compiler ('c++'); install one with: sudo apt install build-essential"),
    ],
)
def test_environment_that_cannot_be_made_names_what_to_install(tmp_path, commands, words):
    found = {'python3': f'#!/bin/sh\nexec {sys.executable} "$@"\n'}
    found |= dict.fromkeys(('cc', 'c++'), '#!/bin/sh\n')
    for name, text in (found | commands).items():
        if text:
            write_command(tmp_path / 'bin' / name, text)
    for name in ('cat', 'sed'):
        (tmp_path / 'bin' / name).symlink_to(shutil.which(name))
    done = run(TOOLS / 'make_venv.sh', 'python3', 'venv', cwd=tmp_path, PATH=str(tmp_path / 'bin'))
    assert done.returncode == 1
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / 'venv').exists()
