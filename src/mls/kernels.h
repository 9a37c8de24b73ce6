// The kernel's instances, one per processor kind; only kernel.cpp chooses among them.
#pragma once
#include "mls/kernel.h"

namespace lamina {
namespace kernel_v2 {
Kernel kernel();
}
namespace kernel_v3 {
Kernel kernel();
}
namespace kernel_v4 {
Kernel kernel();
}
}  // namespace lamina
