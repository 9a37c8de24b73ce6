// Memory that was freed, which the C library keeps for what comes next.
#pragma once

namespace lamina {

/// Gives it back to the system. For between stages: the arrays of the next are of other sizes and would leave gaps
/// where they lie in what the last one had.
void return_free_memory();

}  // namespace lamina
