// Python bindings: check the arguments, release the GIL, call the pure C++ core.
#include <nanobind/nanobind.h>

NB_MODULE(_native, m) { m.doc() = "Native kernels."; }
