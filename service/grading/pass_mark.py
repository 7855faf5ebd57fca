"""The default pass mark."""

from decimal import Decimal

#: A fraction of all marks.
PASS_SHARE = Decimal("0.4")
