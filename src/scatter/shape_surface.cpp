#include <fmt/format.h>
#include <fmt/ranges.h>

#include <functional>
#include <utility>

#include "lamina/error.h"
#include "lamina/scatter.h"
#include "scatter/shape_kinds.h"

namespace lamina {
namespace {

using namespace scatter_detail;
using Maker = std::unique_ptr<Surface> (*)(bool colours);

constexpr std::array<std::pair<const char*, Maker>, 7> kShapes{{
    {"sphere", sphere_surface},
    {"torus", [](bool c) { return torus_surface(1, 0.4, c); }},
    {"plane",
     [](bool c) {
       return box_surface({1, 1, 0}, c);
     }},
    {"cube",
     [](bool c) {
       return box_surface({1, 1, 1}, c);
     }},
    {"thin-sheet",
     [](bool c) {
       return box_surface({1, 1, 0.01}, c);
     }},
    {"bumpy-sphere",
     [](bool c) {
       return radial_surface(bumps(), {1, 1, 1}, c);
     }},
    {"statue",
     [](bool c) {
       return radial_surface(draped_figure(), {0.55, 0.45, 1.4}, c);
     }},
}};

}  // namespace

std::vector<std::string> shape_names() {
  std::vector<std::string> names;
  names.reserve(kShapes.size());
  for (const auto& [name, maker] : kShapes) names.emplace_back(name);
  return names;
}

std::unique_ptr<Surface> shape_surface(const std::string& name, bool colours) {
  for (const auto& [known, maker] : kShapes)
    if (name == known) return maker(colours);
  throw Error(ExitCode::usage, fmt::format("unknown shape \"{}\"; known are {}", name, fmt::join(shape_names(), ", ")));
}

}  // namespace lamina
