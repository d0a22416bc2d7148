# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Table files, NPZ or Parquet, that are joined from parts.

The parts are NPZ files, each with all columns of some rows. Only one part, or one column of a
part, is in memory at a time. A file has a text that describes it, `settings`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import contextlib
import os
from pathlib import Path
from typing import Any
import zipfile

from isotruss_ros.dataset.random_grasps import DatasetError
from isotruss_ros.extras import MissingPackageError
import numpy as np
from numpy.typing import NDArray

#: Name of the text in an NPZ file, and its key among the metadata of a Parquet file.
SETTINGS = 'settings'
SUFFIXES = ('.npz', '.parquet')
#: Data type of a column, and shape of one of its rows.
Form = tuple[np.dtype[Any], tuple[int, ...]]
Forms = Mapping[str, Form]


def check_path(path: Path) -> None:
    """Raise an error unless a table file can be written under a path."""
    if path.suffix not in SUFFIXES:
        raise DatasetError(f'{path}: must end with {" or ".join(SUFFIXES)}')
    if not path.absolute().parent.is_dir():
        raise DatasetError(f'{path}: no folder {path.absolute().parent}; must exist')
    if path.suffix == '.parquet':
        _parquet()


def read_settings(path: Path) -> str:
    """Return the text that describes a table file."""
    parquet = None if path.suffix == '.npz' else _parquet()
    try:
        if parquet is None:
            with np.load(path) as file:
                return str(file[SETTINGS])
        return parquet.read_schema(path).metadata[SETTINGS.encode()].decode()
    except Exception as error:  # the decoders raise any on the bytes of a stranger
        raise DatasetError(f'{path}: no data set of grasps; must be one, or a new file') from error


def write_text(path: Path, text: str) -> None:
    """Write a text file, which exists as a whole or not at all."""
    with _replaced(path) as new:
        new.write_text(text, encoding='utf-8')


def write_part(path: Path, columns: dict[str, NDArray[Any]]) -> None:
    """Write a part, which exists as a whole or not at all."""
    with _replaced(path) as new, new.open('wb') as file:
        np.savez(file, **columns)


def join_parts(path: Path, parts: Mapping[Path, int], forms: Forms, settings: str) -> None:
    """
    Write a table file of all rows of the parts, which exists as a whole or not at all.

    The written file is read once before it gets its name.

    :param parts: number of rows of each part.
    :raises DatasetError: a part is damaged, or its rows are not of the forms.
    """
    with _replaced(path) as new:
        if path.suffix == '.npz':
            _write_npz(new, parts, forms, settings)
            _read_npz(new)
        else:
            _write_parquet(new, parts, forms, settings)
            for _ in _parquet().ParquetFile(new).iter_batches():
                pass


@contextlib.contextmanager
def _replaced(path: Path) -> Iterator[Path]:
    """Yield the path of a new file, which gets its name at the end, or is deleted."""
    new = path.with_name(f'.{path.name}.new')
    try:
        yield new
        os.replace(new, path)
    except OSError as error:
        raise DatasetError(f'{path}: cannot be written: {error.strerror or error}') from error
    finally:
        new.unlink(missing_ok=True)


def _load(part: Path, count: int, name: str, form: Form) -> NDArray[Any]:
    """Return a column of a part; raise DatasetError unless its rows have a number and a form."""
    try:
        with np.load(part) as columns:
            values = np.ascontiguousarray(columns[name])
    except Exception as error:  # the decoders raise any on damaged bytes
        raise DatasetError(f'{part}: damaged: {name}: {error}; delete it and run again') from error
    kind, shape = form
    if (values.dtype, values.shape) != (kind, (count, *shape)):
        raise DatasetError(
            f'{part}: {name} is {values.dtype} {values.shape}: must be {kind} {(count, *shape)}; '
            'delete the part and run again'
        )
    return values


def _write_npz(path: Path, parts: Mapping[Path, int], forms: Forms, settings: str) -> None:
    with zipfile.ZipFile(path, 'w') as archive:
        for name, (kind, shape) in forms.items():
            # A part is small, but the column of all parts may be larger than 2 GiB.
            with archive.open(f'{name}.npy', 'w', force_zip64=True) as file:
                form = {
                    'descr': np.lib.format.dtype_to_descr(kind),
                    'fortran_order': False,
                    'shape': (sum(parts.values()), *shape),
                }
                np.lib.format.write_array_header_1_0(file, form)
                for part, count in parts.items():
                    file.write(_load(part, count, name, forms[name]).tobytes())
        with archive.open(f'{SETTINGS}.npy', 'w') as file:
            np.lib.format.write_array(file, np.array(settings))


def _read_npz(path: Path) -> None:
    """Read an NPZ file, of which only a block is in memory, and compare its checksums."""
    with zipfile.ZipFile(path) as archive:
        if (name := archive.testzip()) is not None:
            raise DatasetError(f'{path}: {name} differs from what was written; run again')


def _write_parquet(path: Path, parts: Mapping[Path, int], forms: Forms, settings: str) -> None:
    parquet, writer = _parquet(), None
    try:
        for part, count in parts.items():
            columns = {name: _load(part, count, name, form) for name, form in forms.items()}
            table = _arrow_table(columns, settings)
            if writer is None:
                writer = parquet.ParquetWriter(path, table.schema)
            writer.write_table(table)
    finally:
        if writer is not None:
            writer.close()


def _arrow_table(columns: dict[str, NDArray[Any]], settings: str) -> Any:
    """Return a table of Arrow; rows of several values are lists of a fixed size."""
    import pyarrow

    arrays = {}
    for name, values in columns.items():
        flat = pyarrow.array(values.ravel())
        is_list = values.ndim == 2
        arrays[name] = (
            pyarrow.FixedSizeListArray.from_arrays(flat, values.shape[1]) if is_list else flat
        )
    return pyarrow.table(arrays).replace_schema_metadata({SETTINGS: settings})


def _parquet() -> Any:
    """Return the module that reads and writes Parquet files."""
    try:
        import pyarrow.parquet
    except ModuleNotFoundError as error:
        raise MissingPackageError(error) from error
    return pyarrow.parquet
