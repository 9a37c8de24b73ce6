#include "normal_options.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <vector>

#include "lamina/error.h"
#include "numbers.h"
#include "words.h"

namespace lamina::tools {
namespace {

void take_viewpoint(NormalsSettings& settings, const std::string& text) {
  if (text == "pose") {
    settings.pose_origins = true;
  } else if (text == "none") {
    settings.scanners = false;
  } else if (const auto at = read_numbers(text, ',', 3)) {
    settings.viewpoints.push_back({{(*at)[0], (*at)[1], (*at)[2]}, false});
  } else {
    throw CLI::ValidationError("--viewpoint", fmt::format("'{}' is not of the form X,Y,Z, nor pose or none", text));
  }
}

}  // namespace

void add_normals_choice(CLI::App& tool, NormalsChoice& normals, const std::string& group) {
  tool.add_option("--normals", normals,
                  "whose normals: the file's; auto: found where the file has none; estimate: all found")
      ->transform(words<NormalsChoice>(
          {{"file", NormalsChoice::file}, {"auto", NormalsChoice::automatic}, {"estimate", NormalsChoice::estimate}}))
      ->option_text("file|auto|estimate [file]")
      ->group(group);
}

void add_normals_options(CLI::App& tool, NormalsSettings& s, const std::string& group) {
  tool.add_option("--k", s.k, "nearest samples that a normal's plane is fitted to")
      ->type_name("N")
      ->capture_default_str()
      ->group(group);
  tool.add_option("--radius", s.radius, "fit to all samples within this instead; 0: to the nearest")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group(group);
  tool.add_option_function<std::vector<std::string>>(
          "--viewpoint",
          [&s](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) take_viewpoint(s, text);
          },
          "normals face this scanner position, the nearest of several, or each scan its own where there are as many; "
          "pose: where each input's pose puts its origin; none: not even the scanners the files know")
      ->type_name("X,Y,Z|pose|none")
      ->allow_extra_args(false)
      ->group(group);
  add_numbers(tool, "--up", ',', 3, "X,Y,Z", "normals face this direction: 0,0,1 for scans from the air",
              [&s](const std::vector<double>& v) {
                s.viewpoints.push_back({{v[0], v[1], v[2]}, true});
              })
      ->group(group);
  tool.add_flag("--flip", s.flip, "turn all normals found or turned to the other side at the end")->group(group);
}

nlohmann::ordered_json normals_json(const NormalsReport& r) {
  nlohmann::ordered_json j;
  j["samples"] = r.samples;
  j["estimated"] = r.estimated;
  j["flipped"] = r.flipped;
  j["without_normal"] = r.without;
  j["sign_from"] = {
      {"viewpoint", r.by_viewpoint}, {"given", r.by_given}, {"outside", r.by_outside}, {"outside_unsure", r.unsure}};
  j["patches"] = r.patches;
  j["components"] = r.components;
  j["sign_conflicts"] = {
      {"pairs", r.conflicts.pairs}, {"conflicts", r.conflicts.conflicts}, {"share", r.conflicts.share()}};
  j["sign_conflicts"]["worst_slab"] = r.worst_slab();
  auto& slabs = j["sign_conflicts"]["slabs"] = nlohmann::ordered_json::array();
  for (const SignConflicts& slab : r.slabs)
    slabs.push_back({{"pairs", slab.pairs}, {"conflicts", slab.conflicts}, {"share", slab.share()}});
  return j;
}

}  // namespace lamina::tools
