"""C code that evaluates a function at several points at once, one in each lane of the processor's vectors.

CasADi's own C code is scalar. A function of scalar operations (SX) is a straight list of instructions, so the same
list with vectors for numbers evaluates `LANES` intervals in about the time of two.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

LANES = 4
"""Points at once: 8 were no faster, with twice the work space. The compiler splits vectors that the machine has not."""

_PREAMBLE = f"""
#include <math.h>
#define LANES {LANES}
typedef double lanes __attribute__((vector_size(8 * LANES)));

static inline lanes all(double x) {{ return x - (lanes){{0}}; }}
static inline lanes take(const double *x, long stride) {{
  lanes y;
  for (int i = 0; i < LANES; i++) y[i] = x[i * stride];
  return y;
}}
static inline void put(double *x, long stride, lanes y) {{
  for (int i = 0; i < LANES; i++) x[i * stride] = y[i];
}}
#define EACH(f) static __attribute__((noinline)) lanes each_##f(lanes x) {{ \\
  for (int i = 0; i < LANES; i++) x[i] = f(x[i]); \\
  return x; \\
}}
"""

_MATH = {
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_SQRT: "sqrt",
    ca.OP_ASIN: "asin",
    ca.OP_TANH: "tanh",  # Coulomb friction
}

_FORMS: dict[int, Callable[..., str]] = {
    ca.OP_ADD: "{} + {}".format,
    ca.OP_SUB: "{} - {}".format,
    ca.OP_MUL: "{} * {}".format,
    ca.OP_DIV: "{} / {}".format,
    ca.OP_NEG: "-{}".format,
    ca.OP_SQ: "{0} * {0}".format,
    ca.OP_TWICE: "{0} + {0}".format,
    ca.OP_INV: "1.0 / {}".format,
    ca.OP_ASSIGN: "{}".format,
    **{op: f"each_{name}({{}})".format for op, name in _MATH.items()},
}


def lanes_source(function: ca.Function, shared: Sequence[int]) -> str:
    """C code of a CasADi external that does what `function.map(LANES)` would, under the function's own name.

    Parameters
    ----------
    function
        Of scalar operations (SX), with dense columns for inputs.
    shared
        Inputs that are the same at all points. The others, and the outputs, come side by side.

    Raises
    ------
    NotImplementedError
        For an operation that no kernel has had so far.
    """
    name = function.name()
    instructions = [_instruction(function, k, shared) for k in range(function.n_instructions())]
    used = {function.instruction_id(k) for k in range(function.n_instructions())}
    into = [ca.repmat(function.sparsity_in(i), 1, 1 if i in shared else LANES) for i in range(function.n_in())]
    out = [ca.repmat(function.sparsity_out(i), 1, LANES) for i in range(function.n_out())]
    lines = [
        _PREAMBLE,
        *(f"EACH({f})" for op, f in _MATH.items() if op in used),
        f"static const double nothing[{max(pattern.nnz() for pattern in into)}];",
        f"int {name}(const double **arg, double **res, long long *iw, double *w, int mem) {{",
        "(void)iw, (void)w, (void)mem;",
        *(f"const double *x{i} = arg[{i}] ? arg[{i}] : nothing;" for i in range(len(into))),
        *(f"double *y{i} = res[{i}];" for i in range(len(out))),
        f"lanes {', '.join(f'w{k}' for k in range(max(function.sz_w(), 1)))};",
        *instructions,
        "return 0;\n}",
        f"long long {name}_n_in(void) {{ return {len(into)}; }}",
        f"long long {name}_n_out(void) {{ return {len(out)}; }}",
        _patterns(f"{name}_sparsity_in", into),
        _patterns(f"{name}_sparsity_out", out),
    ]
    return "\n".join(lines) + "\n"


def _instruction(function: ca.Function, k: int, shared: Sequence[int]) -> str:
    op, into, of = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
    if op == ca.OP_CONST:
        return f"w{into[0]} = all({function.instruction_constant(k)!r});"
    if op == ca.OP_INPUT:
        i, entry = of
        taken = f"all(x{i}[{entry}])" if i in shared else f"take(x{i} + {entry}, {function.nnz_in(i)})"
        return f"w{into[0]} = {taken};"
    if op == ca.OP_OUTPUT:
        i, entry = into
        return f"if (y{i}) put(y{i} + {entry}, {function.nnz_out(i)}, w{of[0]});"
    if op not in _FORMS:
        raise NotImplementedError(f"{function.name()} has operation {op} of CasADi, which lanes.py does not write")
    return f"w{into[0]} = {_FORMS[op](*(f'w{j}' for j in of))};"


def _patterns(name: str, patterns: Sequence[ca.Sparsity]) -> str:
    """Function that hands out sparsity patterns: rows, columns, where each column begins, row of each nonzero."""
    tables = [[*pattern.shape, *pattern.colind(), *pattern.row()] for pattern in patterns]
    lines = [f"static const long long p{i}[] = {{{', '.join(map(str, table))}}};" for i, table in enumerate(tables)]
    choice = ", ".join(f"p{i}" for i in range(len(tables)))
    lines.append(f"static const long long *const patterns[] = {{{choice}}};")
    return "\n".join([f"const long long *{name}(long long i) {{", *lines, "return patterns[i];\n}"])
