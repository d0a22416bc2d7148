# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Put the code of a mutant into a process."""

from __future__ import annotations

import gc
import importlib.abc
from importlib.machinery import SourceFileLoader
import importlib.util
from pathlib import Path
from types import CodeType, FunctionType

from mutation.sites import Mutant, read_source


class MutantFinder(importlib.abc.MetaPathFinder):
    """Imports a changed module in place of the module."""

    def __init__(self, mutant: Mutant, root: Path) -> None:
        path, code = str(mutant.path), mutant.compile_changed()

        class Loader(SourceFileLoader):
            def get_code(self, fullname: str) -> object:
                return code

        self._name = '.'.join(mutant.path.relative_to(root).with_suffix('').parts)
        self._spec = importlib.util.spec_from_file_location(
            self._name, path, loader=Loader(self._name, path)
        )

    def find_spec(self, fullname: str, path: object, target: object = None) -> object:
        """Return the spec of the changed module."""
        return self._spec if fullname == self._name else None


def swap_code(mutant: Mutant) -> bool:
    """
    Give the functions of the imported module the changed code; False if none of them has it.

    What was computed before stays: constants of modules, and what is cached.
    """
    old = compile(read_source(mutant.path), str(mutant.path), 'exec')
    changed = {
        before: after
        for before, after in zip(_codes(old), _codes(mutant.compile_changed()), strict=True)
        if before != after
    }
    functions = [f for f in gc.get_objects() if isinstance(f, FunctionType)]
    functions = [f for f in functions if f.__code__ in changed]
    for function in functions:
        function.__code__ = changed[function.__code__]
    return bool(functions)


def _codes(code: CodeType) -> list[CodeType]:
    """Return the codes in a code, at any depth, in the order of the source."""
    inner = [const for const in code.co_consts if isinstance(const, CodeType)]
    return [deeper for each in inner for deeper in (each, *_codes(each))]
