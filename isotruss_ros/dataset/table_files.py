# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Table files, NPZ or Parquet, that are joined from parts.

The parts are NPZ files, each with all columns of some rows. Only one part, or one column of a
part, is in memory at a time. A file has a text that describes it, `settings`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
    try:
        if path.suffix == '.npz':
            with np.load(path) as file:
                return str(file[SETTINGS])
        return _parquet().read_schema(path).metadata[SETTINGS.encode()].decode()
    except (ValueError, TypeError, KeyError, zipfile.BadZipFile, EOFError) as error:
        raise DatasetError(f'{path}: no data set of grasps; must be one, or a new file') from error


def write_text(path: Path, text: str) -> None:
    """Write a text file, which exists as a whole or not at all."""
    with _replaced(path) as new:
        new.write_text(text, encoding='utf-8')


def write_part(path: Path, columns: dict[str, NDArray[Any]]) -> None:
    """Write a part, which exists as a whole or not at all."""
    with _replaced(path) as new, new.open('wb') as file:
        np.savez(file, **columns)


def join_parts(path: Path, parts: Sequence[Path], count: int, settings: str) -> None:
    """Write a table file of all rows of the parts, which exists as a whole or not at all."""
    with _replaced(path) as new:
        write = _write_npz if path.suffix == '.npz' else _write_parquet
        write(new, parts, count, settings)


@contextlib.contextmanager
def _replaced(path: Path) -> Iterator[Path]:
    """Yield the path of a new file, which gets its name at the end, or is deleted."""
    new = path.with_name(f'.{path.name}.new')
    try:
        yield new
        os.replace(new, path)
    finally:
        new.unlink(missing_ok=True)


@contextlib.contextmanager
def _loaded(part: Path) -> Iterator[Any]:
    """Yield the columns of a part, each of which is read when it is used."""
    try:
        with np.load(part) as columns:
            yield columns
    except (ValueError, KeyError, zipfile.BadZipFile, EOFError) as error:
        raise DatasetError(f'{part}: damaged: {error}; delete it and run again') from error


def _write_npz(path: Path, parts: Sequence[Path], count: int, settings: str) -> None:
    with _loaded(parts[0]) as first:
        heads = {name: (first[name].dtype, first[name].shape[1:]) for name in first.files}
    with zipfile.ZipFile(path, 'w') as archive:
        for name, (kind, shape) in heads.items():
            # A part is small, but the column of all parts may be larger than 2 GiB.
            with archive.open(f'{name}.npy', 'w', force_zip64=True) as file:
                form = {
                    'descr': np.lib.format.dtype_to_descr(kind),
                    'fortran_order': False,
                    'shape': (count, *shape),
                }
                np.lib.format.write_array_header_1_0(file, form)
                for part in parts:
                    with _loaded(part) as columns:
                        file.write(np.ascontiguousarray(columns[name]).tobytes())
        with archive.open(f'{SETTINGS}.npy', 'w') as file:
            np.lib.format.write_array(file, np.array(settings))


def _write_parquet(path: Path, parts: Sequence[Path], _count: int, settings: str) -> None:
    parquet, writer = _parquet(), None
    try:
        for part in parts:
            with _loaded(part) as columns:
                table = _arrow_table({name: columns[name] for name in columns.files}, settings)
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
