"""From recordings to gains, time constants and models, with intervals, or the reason why there is none."""

from truing.callable_package import make_callable

make_callable(__name__)
