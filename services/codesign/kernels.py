"""Compiled kernels: an interval's constraints with first and second derivatives, and one motor's constraints.

The C comes from CasADi's graphs, several intervals to a call (`lanes.py`); the machine's compiler builds it once, and
the library is kept under a hash of everything that shapes it. Without a compiler the same functions run on the CasADi
virtual machine, one interval to a call, about thirty times slower.
"""

from __future__ import annotations

import fcntl
import functools
import hashlib
import json
import os
import platform
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from services.codesign.interval import (
    IntervalLayout,
    demand_expressions,
    interval_expressions,
    parameter_sizes,
    unpack_parameters,
)
from services.codesign.kept import Kept
from services.codesign.lanes import lanes_source
from services.codesign.motor import design_constraints
from services.codesign.motor_data import DIMENSIONS
from services.codesign.robot import Robot

COMPILER_FLAGS = ("-O1", "-fPIC", "-shared")
"""-O1: a third faster to compile than -O2, and the code is no slower (docs/performance.md)."""

LANES_FLAGS = ("-march=native",)
"""Added for code of several lanes: the widest vectors that this machine has."""

BUILD_LOCK_SUFFIX = ".lock"

_SOURCES = {path.stem: path.read_text() for path in Path(__file__).parent.glob("*.py")}
"""As imported: a key made from files that were edited since would name a library of other code."""

_IMPORT = re.compile(r"^from services\.codesign\.(\w+) import", re.MULTILINE)


@dataclass(frozen=True)
class Kernels:
    """Functions of `lanes` intervals and of one motor; `compiled` says whether they are machine code.

    With v = (start, variables, design, final_time) and inputs (start, variables, design, final_time, width,
    parameters), where start, variables, width, multipliers and all outputs have a column (or as many columns as one
    interval's output) for each interval, side by side as `casadi.Function.map` has them:

    - value -> (constraints, effort)
    - jacobian -> d constraints / dv, sparse
    - effort_gradient -> gradient of effort in v, sparse
    - hessian, with multipliers of constraints and effort appended -> upper triangle of the Hessian in v
    - demand: (q, qd, qdd, design, parameters) -> scaled (i_q, u_d, u_q) that a motion needs with i_d = 0
    - motor_value, motor_jacobian, motor_hessian: the same for the design constraints of one motor
    """

    value: ca.Function
    jacobian: ca.Function
    effort_gradient: ca.Function
    hessian: ca.Function
    demand: ca.Function
    motor_value: ca.Function
    motor_jacobian: ca.Function
    motor_hessian: ca.Function
    compiled: bool

    @property
    def lanes(self) -> int:
        """Intervals that a call evaluates."""
        return int(self.value.size2_in(0))

    def pattern(self, name: str) -> Any:
        """Sparsity of one interval's, or one motor's, part of an output."""
        whole = getattr(self, name).sparsity_out(0)
        if name not in OVER_LANES:
            return whole
        return ca.horzsplit(whole, whole.size2() // self.lanes)[0]


SHARED_INPUTS = (2, 3, 5)
"""Design, t_f and parameters are the same in every interval."""

OVER_LANES = dict.fromkeys(("value", "jacobian", "effort_gradient", "hessian"), SHARED_INPUTS)
"""Kernels of several intervals, with the inputs that these share."""


def default_cache() -> Path:
    """Where libraries are kept unless told otherwise: `kernels` under ARMATURE_HOME or ~/.armature."""
    home = os.environ.get("ARMATURE_HOME")
    return (Path(home) if home else Path.home() / ".armature") / "kernels"


MOST_KERNELS = 16
"""Kept in a process: arms times layouts."""

_LOADED: Kept[Kernels] = Kept(MOST_KERNELS)


def load_kernels(robot: Robot, layout: IntervalLayout, cache: Path | None = None) -> Kernels:
    """Kernels of an arm and a layout, compiled now unless the cache holds them; kept in the process.

    Safe when several processes call it at once: one builds, the others wait for it, and all see a whole library.
    """
    folder = default_cache() if cache is None else cache
    key = cache_key(robot, layout)
    return _LOADED.get((key, folder), lambda: _load(robot, layout, folder / f"{key}.so"))


def _load(robot: Robot, layout: IntervalLayout, library: Path) -> Kernels:
    built = build_library(library, lambda: _functions(robot, layout), OVER_LANES)
    return _external(library) if built else _virtual_machine(robot, layout)


def build_library(
    library: Path,
    functions: Callable[[], dict[str, ca.Function]],
    over_lanes: Mapping[str, Sequence[int]] | None = None,
    more_flags: Sequence[str] = (),
) -> bool:
    """Compile functions into a shared library, unless it is there; False where there is no compiler.

    Those named in `over_lanes` evaluate several points at once (`lanes.LANES`); the inputs listed there are the same
    for all. `more_flags` are the compiler's, for the others.
    """
    return build_once(library, lambda compiler: _compile(functions(), over_lanes or {}, more_flags, compiler, library))


def build_once(library: Path, build: Callable[[str], None]) -> bool:
    """Have `build` make a library with a compiler, unless it is there; False where there is no compiler.

    `build` moves the library into place in one step, for others may look for it meanwhile.
    """
    if library.exists():
        return True
    if (compiler := _compiler()) is None:
        return False
    with _build_lock(library):
        if not library.exists():
            build(compiler)
    return True


_building: list[Path] = []
"""Libraries that this process waits for."""


@contextmanager
def _build_lock(library: Path) -> Iterator[None]:
    """Let one process of this machine build a library; a builder that dies lets go of the lock."""
    library.parent.mkdir(parents=True, exist_ok=True)
    with library.with_suffix(BUILD_LOCK_SUFFIX).open("w") as file:
        _building.append(library)
        try:
            fcntl.flock(file, fcntl.LOCK_EX)
            yield
        finally:
            _building.remove(library)


def building() -> bool:
    """Whether this process compiles kernels now, or waits for another one that does."""
    return bool(_building)


def being_built(cache: Path) -> bool:
    """Whether some process of this machine compiles kernels into a cache now, for progress displays."""
    for path in cache.glob(f"*{BUILD_LOCK_SUFFIX}"):
        with path.open() as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return True
    return False


def cache_key(robot: Robot, layout: IntervalLayout) -> str:
    """Hash of everything that shapes the code: arm, layout, model sources, CasADi, compiler flags, machine."""
    return library_key(robot, asdict(layout), "kernels")


def library_key(robot: Robot, form: Any, module: str) -> str:
    """Hash of an arm's numbers, a form (JSON), a module's and its imports' sources, CasADi and the compiler."""
    sources = tuple(_SOURCES[name] for name in made_of(module))
    code = _hash(ca.CasadiMeta.version(), COMPILER_FLAGS, LANES_FLAGS, tuple(processor()), sources)
    return hashlib.sha256(json.dumps([_shaping_numbers(robot), form, code], sort_keys=True).encode()).hexdigest()[:32]


@functools.cache
def _hash(*parts: str | tuple[str, ...]) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


@functools.cache
def made_of(module: str) -> list[str]:
    """A module beside this one and all those that it imports, followed to the end; sorted."""
    found: set[str] = set()
    waiting = {module}
    while waiting:
        found |= waiting
        waiting = {name for each in waiting for name in _IMPORT.findall(_SOURCES[each])} - found
    return sorted(found)


@functools.cache
def processor() -> list[str]:
    """What tells processors apart that need different code: code for this one may not run on another."""
    info = Path("/proc/cpuinfo")
    if not info.exists():
        return [platform.machine(), platform.processor()]
    lines = info.read_text().split("\n\n")[0].splitlines()
    known = ("model name", "flags", "Features", "CPU part", "isa")
    return [platform.machine(), *(line for line in lines if line.startswith(known))]


def _shaping_numbers(robot: Robot) -> dict[str, Any]:
    """What of a robot becomes code. Gear ratios and limits do not: they are parameters."""
    bodies = ("gravity", "screw_axes", "link_com_home", "link_mass", "link_inertia", "motor_position", "tool_home")
    names = (*bodies, "viscous_friction", "coulomb_friction")
    return {name: np.asarray(getattr(robot, name)).tolist() for name in names}


def _functions(robot: Robot, layout: IntervalLayout) -> dict[str, ca.Function]:
    e = interval_expressions(robot, layout)
    v = ca.vertcat(e.start, e.variables, e.design, e.final_time)
    inputs = [e.start, e.variables, e.design, e.final_time, e.width, e.parameters]
    lam_g, lam_e = ca.SX.sym("lam_g", e.constraints.shape[0]), ca.SX.sym("lam_e")
    hessian, _ = ca.hessian(ca.dot(lam_g, e.constraints) + lam_e * e.effort, v)
    interval = {
        "value": (inputs, [e.constraints, e.effort]),
        "jacobian": (inputs, [ca.jacobian(e.constraints, v)]),
        "effort_gradient": (inputs, [ca.jacobian(e.effort, v).T]),
        "hessian": ([*inputs, lam_g, lam_e], [ca.triu(hessian)]),
        "demand": demand_expressions(robot, layout),
    }
    functions = {**interval, **_motor_functions(layout.joints)}
    return {name: ca.Function(name, i, o, {"cse": True}) for name, (i, o) in functions.items()}


def _motor_functions(joints: int) -> dict[str, tuple[list[Any], list[Any]]]:
    design = ca.SX.sym("design", len(DIMENSIONS))
    parameters = ca.SX.sym("parameters", sum(parameter_sizes(joints).values()))
    p = unpack_parameters(parameters, joints)
    values = design_constraints(design * p["design_scale"], p["coefficients"])
    lam = ca.SX.sym("lam", values.shape[0])
    hessian, _ = ca.hessian(ca.dot(lam, values), design)
    return {
        "motor_value": ([design, parameters], [values]),
        "motor_jacobian": ([design, parameters], [ca.jacobian(values, design)]),
        "motor_hessian": ([design, parameters, lam], [ca.triu(hessian)]),
    }


def _virtual_machine(robot: Robot, layout: IntervalLayout) -> Kernels:
    return Kernels(**_functions(robot, layout), compiled=False)


def _external(library: Path) -> Kernels:
    names = [name for name in Kernels.__dataclass_fields__ if name != "compiled"]
    return Kernels(**{name: ca.external(name, str(library)) for name in names}, compiled=True)


def _compiler() -> str | None:
    """The C compiler: $CC, or cc, gcc, clang, whichever is there first."""
    candidates: Iterable[str | None] = (os.environ.get("CC"), "cc", "gcc", "clang")
    return next((path for name in candidates if name and (path := shutil.which(name))), None)


def _compile(
    functions: dict[str, ca.Function],
    over_lanes: Mapping[str, Sequence[int]],
    more_flags: Sequence[str],
    compiler: str,
    library: Path,
) -> None:
    """Generate, compile each function on a thread of its own, link, and move into place in one step."""
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:

        def build(name: str) -> str:
            if name in over_lanes:
                source = lanes_source(functions[name], over_lanes[name])
                return _object(name, source, [compiler, *COMPILER_FLAGS, *LANES_FLAGS], folder)
            return _object(name, _scalar_source(functions[name]), [compiler, *COMPILER_FLAGS, *more_flags], folder)

        objects = list(_map_threads(build, sorted(functions, key=lambda name: -functions[name].n_instructions())))
        built = str(Path(folder) / "kernels.so")
        run_compiler([compiler, *COMPILER_FLAGS, *objects, "-o", built, "-lm"])
        os.replace(built, library)


def _scalar_source(function: ca.Function) -> str:
    generator = ca.CodeGenerator(function.name(), {"with_header": False, "casadi_int": "long long int"})
    generator.add(function)
    return str(generator.dump())


def _object(name: str, source: str, compile: Sequence[str], folder: str) -> str:
    path, target = f"{folder}/{name}.c", f"{folder}/{name}.o"
    Path(path).write_text(source)
    run_compiler([*(part for part in compile if part != "-shared"), "-c", path, "-o", target])
    return target


def _map_threads(call: Any, items: Iterable[Any]) -> Iterable[Any]:
    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        yield from pool.map(call, items)


def run_compiler(command: list[str]) -> None:
    """Run the compiler; RuntimeError with what it said when it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"the C compiler failed: {' '.join(command)}\n{done.stderr.strip()}")
