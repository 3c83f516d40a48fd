"""Each command says what it does, and shows how it is called."""

import pkgutil
import subprocess
import sys

import pytest

from stages import commands

NAMES = [module.name for module in pkgutil.iter_modules(commands.__path__)]


@pytest.mark.parametrize("name", NAMES)
def test_help_has_an_example(name: str) -> None:
    done = subprocess.run([sys.executable, "-m", f"stages.commands.{name}", "--help"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"usage: python -m stages.commands.{name} ")
    examples = done.stdout.partition("\nexamples:\n")[2].splitlines()
    assert any(line.startswith("  ") and ("make " in line or f"stages.commands.{name}" in line) for line in examples)
