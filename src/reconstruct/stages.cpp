#include "reconstruct/stages.h"

#include <fmt/format.h>

namespace lamina {

std::string draw_stages() {
  constexpr int kFarthest = reach_of(Stage::mark).ahead, kWidth = 6;
  const auto slab = [](int offset) { return offset == 0 ? std::string("t") : fmt::format("t{:+}", offset); };
  std::string out = fmt::format("{:<12}", "slab");
  const auto end_line = [&] {
    while (out.back() == ' ') out.pop_back();
    out += '\n';
  };
  for (int s = 0; s <= kFarthest; ++s) out += fmt::format("{:^{}}", slab(s), kWidth);
  end_line();
  for (const StageReach& stage : kStageReach) {
    out += fmt::format("{:<12}", stage.name);
    for (int s = 0; s <= stage.ahead; ++s) out += fmt::format("{:^{}}", s == stage.ahead ? "#" : "=", kWidth);
    end_line();
  }
  return out;
}

}  // namespace lamina
