// What jobs do about samples they cannot use.
#pragma once

namespace lamina {

enum class BadSamples { drop, refuse };

}  // namespace lamina
