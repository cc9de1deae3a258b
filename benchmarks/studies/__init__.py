"""Studies by name: tables that belong to no scene and method. A suite asks for them by ``studies = [...]``.

A study is a function without arguments that returns an `envbench.records.Study`. It is registered here by a function
of its own, whose docstring is what `envbench list studies` prints, and which imports only when it is called.
"""

from __future__ import annotations

from collections.abc import Callable

from envbench.records import Study


def _microfacet_orders() -> Study:
    """Least SHRM orders of the simplified microfacet beside table 5 of RH 2002."""
    from benchmarks.studies import orders

    return orders.microfacet_orders()


def _captured_energy() -> Study:
    """Energy of the simplified microfacet that F = 30 holds by P, beside what is known of it and a product rule."""
    from benchmarks.studies import orders

    return orders.captured_energy()


def _claimed_orders() -> Study:
    """What Lafortune's skin and Kajiya and Kay's hair lose at the orders that RH 2002 claims."""
    from benchmarks.studies import orders

    return orders.claimed_orders()


STUDIES: dict[str, Callable[[], Study]] = {
    "microfacet-orders": _microfacet_orders,
    "captured-energy": _captured_energy,
    "claimed-orders": _claimed_orders,
}
