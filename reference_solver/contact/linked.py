"""Numba functions that are only called by others that it compiles: linked into those, and optimised there.

Numba optimises every function and makes machine code of it, and does both again in each that calls it: of a
loop with dozens of small functions that was a third of the time.
"""

from typing import Any

from llvmlite.binding import Linkage
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, _LowerResult
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.typed_passes import NativeLowering


class LinkedCode(JITCodeLibrary):
    """Code to link with, and not to run by itself."""

    def _optimize_final_module(self) -> None:
        """Leave that to who calls it."""

    def _finalize_final_module(self) -> None:
        """Make no machine code of it."""
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


class WholeCode(JITCodeLibrary):
    """Code that calls linked functions, which nobody else can.

    So LLVM may leave out of an argument what is not used, and puts each function that is called once in the
    place of its call. Numba hands on every number of a tuple of arrays, and a run has 180.
    """

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if function.linkage is Linkage.linkonce_odr:
                function.linkage = Linkage.internal
        super()._optimize_final_module()


@register_pass(mutates_CFG=True, analysis_only=False)
class Callable(LoweringPass):
    """Makes a function known to those that call it, by a name that Python could not call."""

    _name = "callable_by_compiled_functions"

    def __init__(self) -> None:
        LoweringPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Put a key where others have a function with an address; Numba asks for a built-in one."""
        lowered, key = state["cr"], list[Any]().append
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state["cr"] = _LowerResult(lowered.fndesc, lowered.call_helper, cfunc=key, env=lowered.env)
        return True


class InnerCompiler(Compiler):
    """The compiler of such functions, an option of theirs: ``pipeline_class``."""

    def __init__(self, typingctx: Any, targetctx: Any, library: Any, *others: Any) -> None:
        super().__init__(typingctx, targetctx, library or LinkedCode(targetctx.codegen(), "inner"), *others)

    def define_pipelines(self) -> Any:
        """Return Numba's own passes, but for the last of them."""
        self.state.flags.no_compile = True
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.add_pass_after(Callable, NativeLowering)
            pipeline.finalize()
        return pipelines


class WholeCompiler(Compiler):
    """The compiler of what calls them, an option of its: ``pipeline_class``."""

    def __init__(self, typingctx: Any, targetctx: Any, library: Any, *others: Any) -> None:
        if library is None:
            library = WholeCode(targetctx.codegen(), "whole")
            library.enable_object_caching()
        super().__init__(typingctx, targetctx, library, *others)
