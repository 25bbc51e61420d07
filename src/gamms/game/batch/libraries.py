"""Array libraries other than NumPy, such as PyTorch, the device that has the arrays of a batch, and actions there."""

from types import ModuleType
from typing import Any

import numpy as np

from gamms.errors import BadType, BadValue, MissingExtra
from gamms.text import shown

Tensor = Any  # an array of any library that has the array API


class ArrayLibrary:
    """An array library, and the device on which a batch keeps its arrays.

    Args:
        xp: the module: `torch`, `numpy`, or another that has the Python array API.
        device: as the library names it: "cpu", "cuda", ...; None: its default.

    Attributes:
        xp: the namespace with the functions of the array API.
        device: where arrays are put.
        on_host: whether that is the memory of the host, which NumPy shares.
        num_reads: how many arrays the host has read.

    Raises:
        BadType, BadValue: that is no array library, or there is no such device.
        MissingExtra: array-api-compat is not installed.
    """

    def __init__(self, xp: object, device: object = None) -> None:
        self.xp, self.name = _namespace(xp), str(getattr(xp, "__name__", xp))
        try:
            made = self.xp.zeros(1, dtype=self.xp.float64, device=device)
            self.device, self.num_reads = made.device, 0
            self.on_host = "cpu" in str(self.device).lower()
            self.get(made)  # which a device without memory cannot, such as "meta" of PyTorch
        except Exception as error:  # each library raises its own
            raise BadValue(
                f"device={shown(device)} cannot hold the arrays of a batch ({self.name}: {error}). "
                "Give a device that is there, such as device='cpu'."
            ) from error
        self.num_reads = 0

    def __repr__(self) -> str:
        return f"{self.name} on {self.device}"

    def put(self, array: Any) -> Tensor:
        """Return a copy of a NumPy array on the device."""
        return self.xp.asarray(np.ascontiguousarray(array), device=self.device, copy=True)

    def get(self, array: Tensor) -> np.ndarray[Any, Any]:
        """Return an array of the device as one of NumPy, which must not be written: on the host it is the same memory.

        Of another array, what NumPy makes of it.
        """
        self.num_reads += 1
        if self.is_own(array):
            if not self.on_host:
                to_host = getattr(array, "get", None) or getattr(array, "cpu", None)  # of CuPy, of PyTorch
                array = to_host() if to_host else array.to_device(self.xp.__array_namespace_info__().default_device())
            if getattr(array, "requires_grad", False):
                array = array.detach()
        return np.asarray(array)

    def is_own(self, array: object) -> bool:
        """Whether something is an array of this library."""
        return type(array) is type(self.xp.empty(0)) or isinstance(array, type(self.xp.empty(0)))

    def own(self, given: object, what: str) -> Tensor:
        """Return an array of the library on this device; lists and numbers are put there.

        Raises:
            BadType: it is an array of another library, or of no numbers.
            BadValue: it is on another device.
        """
        if self.is_own(given):
            where: Any = given
            if str(where.device) != str(self.device):
                raise BadValue(f"{what} are on {where.device}, the batch on {self.device}: move them there.")
            return given
        if hasattr(given, "__array__") or hasattr(given, "__dlpack__"):
            raise BadType(
                f"{what} are of {type(given).__module__}.{type(given).__name__}, and the batch is one of "
                f"{self.name}: give an array of {self.name} on {self.device}."
            )
        try:
            array = np.asarray(given)
        except ValueError:  # lists of several lengths
            array = np.empty(0, object)
        if array.dtype.kind not in "biuf":
            raise BadType(f"{what} are an array of numbers, not {shown(given)}.")
        return self.put(array)


def as_library(xp: object, device: object) -> ArrayLibrary | None:
    """Return the library that a caller wants for a batch; None: NumPy, as it is."""
    if xp is None:
        if device not in {None, "cpu"}:
            raise BadValue(
                f"device={shown(device)} needs an array library: batch(…, xp=torch, device={shown(device)})."
            )
        return None
    return ArrayLibrary(xp, device)


def _namespace(xp: object) -> Any:
    """Return the functions of the array API of a library."""
    if isinstance(xp, str) or not hasattr(xp, "asarray"):
        raise BadType(f"xp is the module of an array library, such as torch after `import torch`, not {shown(xp)}.")
    if hasattr(xp, "__array_api_version__") and hasattr(xp, "astype"):
        return xp
    try:
        from array_api_compat import array_namespace
    except ImportError as error:
        raise MissingExtra(f"A batch with xp={getattr(xp, '__name__', xp)}", "torch") from error
    try:
        return array_namespace(xp.asarray([0]))
    except TypeError as error:
        raise BadType(f"xp={shown(xp)} has no array API: {error}") from error


def as_actions(given: object, by: str) -> Any:
    """Return actions that `by` has given as an array.

    Raises:
        BadType: they are lists of several lengths.
    """
    try:
        return np.asarray(given)
    except ValueError:
        raise BadType(f"{by}: actions are the numbers of legal nodes, not {shown(given)}.") from None


def refuse_no_actions(given: Tensor, shape: tuple[int, ...], by: str, xp: ModuleType) -> None:
    """Refuse arrays of a library, the namespace `xp`, that are no integers, or not one for each game and agent.

    Raises:
        BadType, BadValue: they are none; the messages begin with `by`, what has given them.
    """
    # NOTE: isdtype of NumPy takes 3 us, more than all else of this (benchmarks: batches).
    is_integer = given.dtype.kind in "iu" if xp is np else xp.isdtype(given.dtype, "integral")
    if not is_integer and 0 not in given.shape:
        raise BadType(f"{by}: actions are the numbers of legal nodes, not {shown(given)}.")
    if tuple(given.shape) != tuple(shape):
        raise BadValue(
            f"{by}: there is one action for each game and agent, an array {tuple(shape)}, "
            f"not one of the shape {tuple(given.shape)}."
        )
