"""After the set-up a diagnosis compiles nothing."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "example"

# In one process: what is compiled or taken from the cache ahead, and what a diagnosis adds to it.
PROGRAM = """
import gc, json, runpy, sys
from click.testing import CliRunner
from numba.core.dispatcher import Dispatcher
from truing.cli import group
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.simulation.assemble import kernel_of
from truing.diagnose.simulation.warm import is_compiled

def signatures():
    functions = (each for each in gc.get_objects() if isinstance(each, Dispatcher))
    return {f"{each.py_func.__module__}.{each.py_func.__name__}{each_one}"
            for each in functions for each_one in each.signatures}

runpy.run_module("truing.diagnose.compile_ahead", run_name="__main__")
ahead, kept = signatures(), all(is_compiled(kernel_of(CATALOGUE, wheels)) for wheels in (1, 2))
done = CliRunner().invoke(group, ["diagnose", sys.argv[1]], catch_exceptions=False)
assert done.exit_code == 0, done.output
print(json.dumps({"kept": kept, "ahead": sorted(ahead), "later": sorted(signatures() - ahead)}))
"""


def test_a_diagnosis_needs_no_machine_code_but_what_was_compiled_ahead() -> None:
    command = [sys.executable, "-c", PROGRAM, str(EXAMPLE)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["kept"]
    assert any("rollout" in each for each in found["ahead"])
    assert found["later"] == []
