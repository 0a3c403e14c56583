"""The solver: versions, and one solve whose answer is known."""

from __future__ import annotations

import contextlib
import io
import json
import platform
import subprocess
import sys
from importlib.metadata import version
from typing import Any

from armature.doctor.finding import Finding, fail, ok, warn
from shared.settings import Settings

SOLVE_TIMEOUT_S = 600.0
"""Kernels that are not there yet are compiled first."""
SLOW_S = 10.0
"""Usual is about one second."""
STRANGE = "the numbers of this machine cannot be trusted: please report it with the output of 'armature doctor --json'"


def versions() -> Finding:
    """What shapes a number. IPOPT tells its version only when it runs."""
    import casadi as ca

    x = ca.SX.sym("x")
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        options: dict[str, Any] = {"print_time": False, "ipopt": {"print_level": 5}}
        ca.nlpsol("solver", "ipopt", {"x": x, "f": x**2}, options)(x0=1)
    ipopt = said.getvalue().partition("This is Ipopt version ")[2].partition(",")[0] or "of unknown version"
    own, casadi = version("armature-codesign"), ca.CasadiMeta.version()
    return ok("versions", f"armature {own}, CasADi {casadi}, IPOPT {ipopt}, Python {platform.python_version()}")


def trial_solve(settings: Settings) -> Finding:
    """Solve one task with a known answer, in a process of its own: code for another processor would end it."""
    command = [sys.executable, "-m", "armature.doctor.trial", str(settings.kernel_cache)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SOLVE_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        return fail("test solve", f"no answer after {SOLVE_TIMEOUT_S:g} s", STRANGE)
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1:] or ["it printed nothing"]
        how = f"signal {-done.returncode}" if done.returncode < 0 else f"exit code {done.returncode}"
        return fail("test solve", f"its process ended ({how}): {last[0]}", "empty the kernels' folder, and try again")
    return judged(json.loads(done.stdout.splitlines()[-1]))


def judged(trial: dict[str, Any]) -> Finding:
    """What `armature.doctor.trial` printed, as a finding."""
    seconds, solver = trial["solve_time_s"], trial["linear_solver"]
    if not trial["success"]:
        return fail("test solve", f"failed: {trial['status']}", STRANGE)
    found = f"{seconds:.2f} s, {trial['iterations']} iterations, linear solver {solver}"
    if trial["prepare_time_s"] > 1.0:
        found += f"; {trial['prepare_time_s']:.0f} s to compile kernels, once"
    reached, expected = trial["final_time_s"], trial["expected_s"]
    if abs(reached - expected) > trial["tolerance_s"]:
        return fail("test solve", f"{found}; final time {reached:.6f} s, not {expected:.6f} s", STRANGE)
    if solver == "mumps" or not trial["compiled"]:
        return warn("test solve", f"{found}; nothing is compiled", "see what is said about the compiler above")
    if seconds > SLOW_S:
        return warn("test solve", found, "the machine is slow, or busy with something else; about 1 s is usual")
    return ok("test solve", found)
