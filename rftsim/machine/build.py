"""Compiles the entries with numba to object files, and writes those that ship: `make native`."""

import importlib
import logging
import multiprocessing
import re
import sys
import types
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, Final

import llvmlite.binding as llvm
import numba
from numba import njit
from numba import types as numba_types

_LOG: Final = logging.getLogger(__name__)
_PARTS: Final = {
    "law": ("rftsim.law.exports",),
    "solver": ("rftsim.solver.newton", "rftsim.solver.time_step"),
    "engine": ("rftsim.engine.callbacks",),
}
"""The modules whose functions a part exports."""
_GIVING: Final = ("machine.link", "law.layout", "engine.layout")
"""The modules that know what the machine code is keyed by."""
_C: Final = {numba_types.void: "void", numba_types.intp: "i64", numba_types.intc: "i32", numba_types.float64: "double"}
_OUTSIDE: Final = re.compile(
    r"rftsim_\w+|mj[du]?_\w+|PyMem_RawMalloc|PyMem_RawCalloc|PyMem_RawFree|atan2|sqrt|llvm\..*"
)
"""Names that an object may take from elsewhere."""
_RAISED: Final = re.compile(r'(@\.const\.pickledata\.\S+ = .*\[\d+ x i8\]) c"[^"]*"')
"""Errors that numba would raise, which may name files of this machine; nobody reads them."""
_FAILED: Final = "rftsim_failed"
_COUNTING: Final = re.compile(r"^define linkonce_odr void (@NRT_(?:in|de)cref)\(.*?^}$", re.MULTILINE | re.DOTALL)
_UNCOUNTED: Final = r"define linkonce_odr void \1(ptr %memory) alwaysinline { ret void }"
"""How numba counts references to an array, and how it does not: each is a view of memory that nobody counts."""


def build(part: str, target: Any = None) -> bytes:
    """The object file of a part, for this processor, or for one of `targets` that numba was told of."""
    for module in _PARTS[part]:
        importlib.import_module(module)
    from rftsim.machine.exports import EXPORTED

    for name in EXPORTED:  # numba links what it compiles, though none of it runs before it is all here
        if llvm.address_of_symbol(name) is None:
            llvm.add_symbol(name, id(EXPORTED))
    own = {name: entry for name, entry in EXPORTED.items() if entry[0].__module__ in _PARTS[part]}
    whole = llvm.parse_assembly("")
    for name, (function, signature) in own.items():
        _LOG.info("compiling %s", name)
        compiled = njit(signature, no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)
        result = compiled.overloads[signature.args]
        code = _RAISED.sub(r"\1 zeroinitializer", compiled.inspect_llvm(signature.args))
        whole.link_in(llvm.parse_assembly(_COUNTING.sub(_UNCOUNTED, code)))
        whole.link_in(llvm.parse_assembly(_entry(name, signature, result.fndesc.mangled_name)))
    machine = _machine(target)
    _strip(whole, own, machine)
    _optimise(whole, machine)
    return bytes(machine.emit_object(whole))


def _entry(name: str, signature: Any, compiled: str) -> str:
    """A C function that calls a compiled one, and says where that raised something."""
    c = _C[signature.return_type]
    result = "ptr" if c == "void" else c
    parameters = ", ".join(f"{_C[argument]} %a{k}" for k, argument in enumerate(signature.args))
    return f"""
        @name.{name} = private constant [{len(name) + 1} x i8] c"{name}\\00"
        declare void @{_FAILED}(ptr)
        declare i32 @"{compiled}"(ptr, ptr{"".join(f", {_C[a]}" for a in signature.args)})
        define {c} @{name}({parameters}) {{
            %result = alloca {result}
            %raised = alloca ptr
            store {result} zeroinitializer, ptr %result
            %status = call i32 @"{compiled}"(ptr %result, ptr %raised, {parameters})
            %bad = icmp ne i32 %status, 0
            br i1 %bad, label %failed, label %done
        failed:
            call void @{_FAILED}(ptr @name.{name})
            br label %done
        done:
            {"ret void" if c == "void" else f"%value = load {c}, ptr %result"}
            {"" if c == "void" else f"ret {c} %value"}
        }}
    """


def _machine(target: Any) -> llvm.TargetMachine:
    """Make what emits code as numba's own does."""
    cpu = target.name if target else llvm.get_host_cpu_name()
    features = target.tuned if target else llvm.get_host_cpu_features().flatten()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=cpu, features=features, opt=3, reloc="static", codemodel="jitdefault", jit=True
    )


def _strip(module: llvm.ModuleRef, keep: Any, machine: llvm.TargetMachine) -> None:
    """Leave the entries and what they call."""
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration and value.name not in keep:
            value.linkage = "private"
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, _builder(machine))
    for value in (*module.functions, *module.global_variables):
        if value.is_declaration and not _OUTSIDE.fullmatch(value.name):
            raise RuntimeError(f"compiled code needs {value.name}, which machine code on its own cannot have")


def _optimise(module: llvm.ModuleRef, machine: llvm.TargetMachine) -> None:
    """Once more, as a whole: what calls what is known now, so that arguments which nobody reads can go."""
    builder = _builder(machine)
    builder.getModulePassManager().run(module, builder)


def _builder(machine: llvm.TargetMachine) -> llvm.PassBuilder:
    return llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))


def ship() -> None:
    """Write the object files that ship, of the parts whose sources changed, side by side, and the list of their hashes.

    Raises:
        OSError: One cannot be written.
    """
    link, given = _alone()
    changed = [
        (part, place)
        for part in _PARTS
        for place, target in enumerate(link.TARGETS[part])
        if not link.is_made_from(link.shipped_file(part, target), link.key_of(part, given[part]))
    ]
    apart = multiprocessing.get_context("spawn")  # what a process compiled before changes what it makes next
    with ProcessPoolExecutor(mp_context=apart, max_tasks_per_child=1) as processes:
        for done in [processes.submit(_ship_part, *one) for one in changed]:
            done.result()
    link.SUMS.write_text("".join(f"{link.sum_of(path)}  {path.name}\n" for path in sorted(link.SHIPPED.glob("*.xz"))))


def _alone() -> tuple[Any, dict[str, str]]:
    """Stand in for the package, which would compile for this machine first; the linker, and what keys each part."""
    package = types.ModuleType("rftsim")
    package.__path__ = [str(Path(__file__).parent.parent)]
    sys.modules["rftsim"] = package
    link, laws, structs = (importlib.import_module(f"rftsim.{name}") for name in _GIVING)
    structs.publish()
    return link, {"law": laws.GIVEN, "solver": laws.GIVEN, "engine": structs.GIVEN}


def _ship_part(part: str, place: int) -> None:
    link, given = _alone()
    target = link.TARGETS[part][place]
    logging.basicConfig(level=logging.INFO, format=f"{target.name}: %(message)s")
    numba.config.CPU_NAME, numba.config.CPU_FEATURES = target.name, target.tuned
    path = link.shipped_file(part, target)
    if not link.write(path, link.key_of(part, given[part]), build(part, target)):
        raise OSError(f"cannot write {path}")


if __name__ == "__main__":
    ship()
