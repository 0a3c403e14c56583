"""How tables look."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table


def new_table(*columns: str, left: int = 1) -> Table:
    """A table without vertical lines; all columns but the first `left` hold numbers. Units go under the names."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, padding=(0, 1, 0, 0))
    for k, name in enumerate(columns):
        table.add_column(name, justify="left" if k < left else "right", no_wrap=True)
    return table


def print_table(console: Console, title: str, table: Table) -> None:
    """A table under its title, which may be wider than the table."""
    console.print(title, style="bold", soft_wrap=True)
    console.print(table)
