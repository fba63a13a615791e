"""Compilation of kernels: lazy, cached on disk, without the interpreter lock.

A cached kernel is valid as long as no source file of its folder changes, nor of the folders of kernels that its file
imports, nor this file, the one of references and the table of sRGB: the machine code of a kernel contains that of the
kernels it calls. The cache of numba alone notices changes in a kernel's own file only.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import threading
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba import types
from numba.core import event
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.dispatcher import Dispatcher
from numba.core.typing import templates
from numba.extending import intrinsic, overload

from .references import taken


class Cache(FunctionCache):
    """Disk cache of numba: kernels are compiled again if it cannot be read, and not cached if it cannot be written.

    A file may be truncated, may lie on a full disk, or may name modules that have been renamed since: a renamed
    folder has the same sources. Unpickling then raises errors of any type.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = IndexDataCacheFile(self._cache_path, self._impl.filename_base, _stamp(function))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled kernel of a signature; None if none can be read."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store a compiled kernel, if the disk can be written."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)


_STAMPS: dict[str, str] = {}


def _stamp(function: Callable[..., Any]) -> str:
    """Return the hash of all sources that the machine code of a file's kernels depends on."""
    file = function.__code__.co_filename
    if file not in _STAMPS:  # the first kernel of its file: the imports above it are done
        folders = {Path(file).parent}
        _add_folders(function.__globals__, folders, set())
        here = Path(__file__)
        sources = [
            here,
            *map(here.with_name, ("colour.py", "references.py")),
            *(source for folder in folders for source in folder.glob("*.py")),
        ]
        _STAMPS[file] = hashlib.sha256(b"".join(sorted(map(_source, sources)))).hexdigest()
    return _STAMPS[file]


def _add_folders(namespace: dict[str, Any], folders: set[Path], seen: set[int]) -> None:
    """Add the folders of all kernels of a file, of those that their files import, and so on."""
    seen.add(id(namespace))
    for value in namespace.values():
        if isinstance(value, Dispatcher) and id(value.py_func.__globals__) not in seen:
            folders.add(Path(value.py_func.__code__.co_filename).parent)
            _add_folders(value.py_func.__globals__, folders, seen)


@cache
def _source(file: Path) -> bytes:
    """Return the hash of a source file and its name, the same in every copy of its folder."""
    return hashlib.sha256(file.name.encode() + b"\0" + file.read_bytes()).digest()


# A kernel that does not state these has those of the kernel that happens to call it first.
_STATED: dict[str, Any] = dict(fastmath=False, forceinline=False, error_model="python", no_cfunc_wrapper=True)


def kernel(function: Callable[..., Any], **options: Any) -> Any:
    """Compile on the first call and cache the result; without a writable folder, only compile."""
    compiled = numba.njit(nogil=True, **{**_STATED, **options})(function)
    with contextlib.suppress(RuntimeError):  # no cache folder can be written
        compiled._cache = Cache(function)  # as numba's own enable_caching does
    return compiled


def array_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that creates arrays; division by zero gives infinity or NaN, as in numpy."""
    return kernel(function, error_model="numpy")


def lean_kernel(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a kernel that creates no arrays, without reference counting.

    Counting takes one locked instruction per array at every call of a function with several returns: 36 ns for four
    arrays. Division by zero gives infinity or NaN, as in numpy. A product and a following sum may be one fused
    instruction with one rounding, which saves a tenth of the time of shading.
    """
    return kernel(function, _nrt=False, error_model="numpy", fastmath={"contract"}, **options)


def exact_kernel(function: Callable[..., Any]) -> Any:
    """Compile a lean kernel that rounds after every operation: bitwise equal results on every CPU."""
    return kernel(function, _nrt=False, error_model="numpy")


def lane_kernel(function: Callable[..., Any]) -> Any:
    """Compile a lean kernel whose short loops over lanes become vectors.

    LLVM's usual passes unroll a loop of 16 rounds before they look for vectors, and then find few. Here no loop is
    unrolled: loops within loops over lanes are to be written out.
    """
    return lean_kernel(function, pipeline_class=_LaneCompiler)


def inner_kernel(function: Callable[..., Any]) -> Any:
    """Compile a lean kernel whose machine code is inlined into its callers, of which Python may be one."""
    return lean_kernel(function, forceinline=True)


def part_kernel(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a lean kernel that other kernels call; Python runs its source.

    Without the code that takes Python's arguments apart, which takes longer to compile than most parts themselves:
    tables of surfaces and rays are some sixty arrays.
    """
    return _part(function, **{"fastmath": {"contract"}, **options})


def stage_kernel(function: Callable[..., Any]) -> Any:
    """Compile a part whose machine code is inlined into its callers."""
    return part_kernel(function, forceinline=True)


def exact_stage_kernel(function: Callable[..., Any]) -> Any:
    """Compile a part as `stage_kernel` does, which rounds after every operation as `exact_kernel` does."""
    return _part(function, forceinline=True)


def lane_stage(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a part of a `lane_kernel`, inlined as that of `stage_kernel` is, whose loops are left as they are."""
    return _part(function, _LanePartCompiler, **{"forceinline": True, "fastmath": {"contract"}, **options})


def lane_part(function: Callable[..., Any]) -> Any:
    """Compile a part of a `lane_kernel` that stays a function of its own, as that of `part_kernel` does."""
    return _part(function, _LanePartCompiler, fastmath={"contract"})


def exact_lane_stage(function: Callable[..., Any]) -> Any:
    """Compile a part as `lane_stage` does, which rounds after every operation as `exact_kernel` does."""
    return _part(function, _LanePartCompiler, forceinline=True)


def fused(a: Any, b: Any, c: Any) -> Any:
    """Return a · b + c, with one rounding where the CPU can: also of a product that is used elsewhere."""
    return a * b + c


@overload(fused, strict=False)
def _fused(a: Any, b: Any, c: Any) -> Any:
    return lambda a, b, c: _multiply_add(a, b, c)


def _multiply_add_code(typing: Any, a: Any, b: Any, c: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        real = values[0].type
        function = builder.module.declare_intrinsic("llvm.fmuladd", [real], ir.FunctionType(real, [real] * 3))
        return builder.call(function, values)

    return a(a, a, a), generate


_multiply_add: Any = intrinsic(_multiply_add_code)


def compiled_by(typing: Any) -> Any:
    """Have kernels take the code of an intrinsic in place of a function, whose source Python runs."""

    def replaced(function: Any) -> Any:
        template = templates.make_intrinsic_template(function, typing, function.__name__)
        templates.infer(template)
        templates.infer_global(function, types.Function(template))
        return function

    return replaced


class _RareCollection(event.Listener):
    """While numba compiles, Python looks for garbage less often: a tenth of the time for 2 % more memory."""

    def __init__(self) -> None:
        self.lock, self.depth, self.before = threading.Lock(), 0, gc.get_threshold()

    def on_start(self, event: Any) -> None:
        """Raise the thresholds at the outermost start."""
        with self.lock:
            if not self.depth:
                self.before = gc.get_threshold()
                gc.set_threshold(max(20_000, self.before[0]) if self.before[0] else 0, 10, 10)
            self.depth += 1

    def on_end(self, event: Any) -> None:
        """Put them back at the last end."""
        with self.lock:
            self.depth -= 1
            if not self.depth:
                gc.set_threshold(*self.before)


event.register("numba:compile", _RareCollection())


class _Fragment(JITCodeLibrary):
    """Code of a part: LLVM optimises and translates it within its callers, not for itself as well."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> Any:
        return _NoEnvironments()


class _NoEnvironments:
    """Lean kernels raise nothing and make no objects: a part needs no environment of Python."""

    def set_env(self, name: str, environment: Any) -> None:
        pass


class _LaneFragment(_Fragment):
    """Code of a part whose loops are left to its callers."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout


class _Lanes(JITCodeLibrary):
    """Code whose loops are not unrolled."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        options = llvm.create_pipeline_tuning_options(3)
        options.loop_vectorization, options.slp_vectorization, options.loop_unrolling = True, False, False
        builder = llvm.create_pass_builder(self._codegen._tm, options)
        builder.getModulePassManager().run(self._final_module, builder)


class _PartCompiler(CompilerBase):
    """Numba's compiler with a `_Fragment` for a library."""

    fragment: type[JITCodeLibrary] = _Fragment

    def define_pipelines(self) -> list[Any]:
        self.state.library = self.fragment(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        self.state.library.enable_object_caching()
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]


class _LaneCompiler(_PartCompiler):
    """Numba's compiler with a library of `_Lanes`."""

    fragment = _Lanes


class _LanePartCompiler(_PartCompiler):
    """Numba's compiler with a `_LaneFragment` for a library."""

    fragment = _LaneFragment


def _part(function: Callable[..., Any], compiler: type[_PartCompiler] = _PartCompiler, **options: Any) -> Any:
    flags = {**_STATED, "_nrt": False, "no_cpython_wrapper": True, "error_model": "numpy", **options}
    compiled: Any = numba.njit(nogil=True, pipeline_class=compiler, **flags)(function)
    compiled.add_overload = lambda result: _keep(compiled, result)
    compiled._compile_for_args = lambda *_, **__: function
    compiled.get_call_template = lambda arguments, keywords: Dispatcher.get_call_template(
        compiled,
        tuple(taken(kind) for kind in arguments),
        {name: taken(kind) for name, kind in keywords.items()},
    )
    return compiled


def late_kernel(function: Callable[..., Any]) -> Any:
    """Compile a lean kernel that other kernels call by its `address`: only when something needs it.

    Returns nothing, as C function. Its callers neither contain it nor optimise it a second time.
    """
    return _late(lean_kernel(function, no_cpython_wrapper=True, no_cfunc_wrapper=False))


def late_lane_kernel(function: Callable[..., Any]) -> Any:
    """Compile a late kernel whose loops over lanes become vectors, as those of a `lane_kernel`."""
    return _late(lean_kernel(function, no_cpython_wrapper=True, no_cfunc_wrapper=False, pipeline_class=_LaneCompiler))


def _late(compiled: Any) -> Any:
    compiled.add_overload = lambda result: _keep(compiled, result)
    return compiled


def address(compiled: Any, arguments: tuple[Any, ...]) -> int:
    """Return the address of a late kernel for arguments of these numba types; compile it on first use."""
    compiled.compile(arguments)
    found = compiled.overloads[arguments]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name))


def _keep(compiled: Any, result: Any) -> None:
    """Keep a compiled kernel that Python cannot call: numba's own way would have calls go to its wrapper."""
    compiled.overloads[tuple(result.signature.args)] = result


class _First(event.Listener):
    """Listener for the first compilation."""

    def __init__(self, tell: Callable[[bool], None]) -> None:
        self.tell: Callable[[bool], None] | None = tell

    def on_start(self, event: Any) -> None:
        """Tell, once; numba has not found the kernel on the disk."""
        tell, self.tell = self.tell, None
        if tell is not None:
            tell(isinstance(event.data["dispatcher"]._cache, FunctionCache))

    def on_end(self, event: Any) -> None:
        """Do nothing."""


@contextlib.contextmanager
def compilation_told(tell: Callable[[bool], None]) -> Iterator[None]:
    """Call ``tell(kept)`` when the block compiles its first kernel; ``kept`` is whether the disk will hold it."""
    listener = _First(tell)
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)
