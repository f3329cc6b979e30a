"""Packages that only some functions need."""

from __future__ import annotations

import importlib
from typing import Any

__all__ = ["needed"]


def needed(module: str) -> Any:
    """Imports a module of an optional package.

    Raises:
        ModuleNotFoundError: The package is not installed; the message says how to install it.
    """
    package = module.partition(".")[0]
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        message = f"{package} is not installed: pip install {package}"
        raise ModuleNotFoundError(message, name=package) from error
