#include "reconstruct/stages.h"

#include <fmt/format.h>

namespace lamina {

std::string draw_stages() {
  constexpr int kFarthest = reach_of(Stage::mark).ahead, kWidth = 6;
  const auto slab = [](int offset) { return offset == 0 ? std::string("t") : fmt::format("t{:+}", offset); };
  std::string out = fmt::format("{:<12}", "slab");
  for (int s = 0; s <= kFarthest; ++s) out += fmt::format("{:^{}}", slab(s), kWidth);
  out += '\n';
  for (const StageReach& stage : kStageReach) {
    out += fmt::format("{:<12}", stage.name);
    for (int s = 0; s <= stage.ahead; ++s) out += fmt::format("{:^{}}", s == stage.ahead ? "#" : "=", kWidth);
    while (out.back() == ' ') out.pop_back();
    out += '\n';
  }
  return out;
}

}  // namespace lamina
