"""The diagnosis: where a simulation differs from recordings, and which physics it leaves out."""

from truing.callable_package import make_callable

make_callable(__name__)
