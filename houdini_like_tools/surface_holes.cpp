#include "surface_holes.h"

namespace lamina::tools {

void add_hole_options(CLI::App& tool, SurfaceSettings& settings, const std::string& group) {
  tool.add_option("--close-holes", settings.close_holes,
                  "close holes with a rim shorter than so many influence radii where the surface around tells how it "
                  "goes on; 0: none")
      ->type_name("RADII")
      ->capture_default_str()
      ->group(group);
  tool.add_option_function<std::string>(
          "--watertight",
          [&settings](const std::string& word) {
            settings.watertight = word == "auto" ? std::nullopt : std::optional(word == "yes");
          },
          "close all holes, whatever lies around, unless a rim longer than three times --close-holes shows that the "
          "surface is an open one; auto: where --blend auto finds a clean, even cloud")
      ->check(CLI::IsMember({"auto", "yes", "no"}))
      ->type_name("auto|yes|no")
      ->default_str("auto")
      ->group(group);
}

nlohmann::ordered_json holes_json(const HoleStats& h) {
  nlohmann::ordered_json j{{"closed", h.closed},
                           {"closed_edges", h.closed_edges},
                           {"added_vertices", h.vertices},
                           {"added_triangles", h.triangles},
                           {"open", h.open},
                           {"open_edges", h.open_edges},
                           {"open_length", h.open_length}};
  j["longest_open"] = nlohmann::ordered_json::array();
  for (const OpenLoop& loop : h.longest) {
    j["longest_open"].push_back({{"position", loop.position},
                                 {"length", loop.length},
                                 {"radii", loop.radii},
                                 {"edges", loop.edges},
                                 {"why", loop.reason}});
  }
  return j;
}

}  // namespace lamina::tools
