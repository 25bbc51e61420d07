"""Operations on whole recordings: replay, verify, compare and convert.

The command line uses these functions; programs may call the same. A client: it uses contexts and recordings as any
program would. Read `conversion.py` first: a new context for any recording; then `comparison.py`.
"""

from gamms.errors import list_names as _list_names
from gamms.recordings.comparison import Difference, first_difference, verify
from gamms.recordings.conversion import (
    context_for,
    records_of,
    to_csv,
    to_json_lines,
    to_version_3,
    version_of,
    watch,
    with_sensed,
)

__all__ = [
    "Difference",
    "context_for",
    "first_difference",
    "records_of",
    "to_csv",
    "to_json_lines",
    "to_version_3",
    "verify",
    "version_of",
    "watch",
    "with_sensed",
]
_list_names(__name__, __all__)
