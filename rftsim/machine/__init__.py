"""Everything that is not physics: addresses, exported functions, object files and where they are kept.

Why there is machine code at all. MuJoCo calls the sand at each step, from any thread, with no interpreter at hand: so
what it calls is compiled, by numba, from the modules of `law`, `solver` and `engine`. Nobody who installs rftsim should
wait for that, so the result is shipped, and numba is needed only where something is compiled.

Why addresses. Numba links whatever a compiled function calls into it and optimises all of it again, level by level;
what a function takes as arrays multiplies in its signature. A function of plain addresses that is called by its name is
compiled once. So there are two seams: an *exported* function (`exports.entry`) is a C function of addresses and
numbers, `rftsim_NAME`; a *table* (`table`) is a piece of memory that holds many arrays, of which an exported function
takes the address alone. On the inside, an address becomes an array (`memory`), a record with named fields or a named
tuple (`records`).

How a function is compiled. `kernel` marks what stays Python where there is no numba, which is how a law is written;
`compiling` has the decorators of everything else. Each says what liberties its arithmetic takes.

How the object files are made. `build` compiles the exported functions of a part (the laws with the solver, the engine),
links and optimises them as a whole, and emits an object file; `make native` writes those that ship to `shipped`.

How they are keyed. By the SHA-256 of the sources (`sources`) and of what else is compiled in: the sand's parameters,
MuJoCo's constants. What fits is taken: from `shipped`, else from where numba keeps its cache, else it is compiled now.

How they are checked. `shipped/SHA256SUMS` lists what `make native` wrote; `link` passes over a file that is not as
listed. A slow test builds them again and compares them byte for byte.

What must outlive a call belongs to an mjData and is found by number (`registry`, and `claims` for compiled code).
"""
