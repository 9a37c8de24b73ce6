#include "lamina/edit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>

#include "base/number.h"
#include "base/run.h"
#include "edit/rows.h"
#include "lamina/error.h"

namespace lamina {
namespace {

template <class T>
std::uint64_t replace_non_finite(std::vector<T>& values) {
  std::uint64_t replaced = 0;
  for (T& value : values) {
    if (std::isfinite(value)) continue;
    value = 0;
    ++replaced;
  }
  return replaced;
}

/// A point without a normal is still a point: PCL, for one, writes NaN where a point has too few neighbours.
std::uint64_t replace_normals(SampleBatch& b) {
  std::uint64_t replaced = 0;
  for (std::size_t i = 0; i < b.nx.size(); ++i) {
    if (std::isfinite(b.nx[i]) && std::isfinite(b.ny[i]) && std::isfinite(b.nz[i])) continue;
    b.nx[i] = b.ny[i] = b.nz[i] = 0;
    ++replaced;
  }
  return replaced;
}

}  // namespace

bool is_finite_row(const SampleBatch& b, std::size_t i) {
  const bool radius = b.radius.empty() || std::isfinite(b.radius[i]);
  return radius && std::isfinite(b.x[i]) && std::isfinite(b.y[i]) && std::isfinite(b.z[i]);
}

EditReport clean_rows(SampleBatch& batch) {
  return clean_rows(batch, std::vector<std::uint8_t>(batch.size(), 1));
}

EditReport clean_rows(SampleBatch& batch, std::vector<std::uint8_t> keep) {
  EditReport report;
  report.read = batch.size();
  for (std::size_t i = 0; i < batch.size(); ++i) {
    if (keep[i] == 0 || is_finite_row(batch, i)) continue;
    keep[i] = 0;
    if (report.bad_rows++ == 0) report.first_bad_row = batch.first + i;
  }
  if (std::find(keep.begin(), keep.end(), 0) != keep.end()) keep_rows(batch, keep);
  report.replaced_normals = replace_normals(batch);
  report.replaced_values = replace_non_finite(batch.quality);
  for (std::size_t a = 0; a < batch.attributes.size(); ++a) {
    // A double may be finite where the float beside it is not.
    const bool exact = a < batch.exact.size() && !batch.exact[a].empty();
    const std::uint64_t floats = replace_non_finite(batch.attributes[a]);
    report.replaced_values += exact ? replace_non_finite(batch.exact[a]) : floats;
  }
  return report;
}

void add(EditReport& total, const EditReport& batch) {
  total.read += batch.read;
  total.bad_rows += batch.bad_rows;
  total.replaced_normals += batch.replaced_normals;
  total.replaced_values += batch.replaced_values;
  if (batch.first_bad_row) total.first_bad_row = std::min(*batch.first_bad_row, total.first_bad_row.value_or(~0ULL));
}

void refuse_bad_row(const EditReport& report, const std::string& path) {
  throw Error(ExitCode::unreadable, fmt::format("{}: row {} (counted from 0) is not finite; clean the file or use "
                                                "--bad-samples drop",
                                                path, report.first_bad_row.value_or(0)));
}

EditReport edit_points(PointSource& source, PointsWriter& writer, const EditBatch& edit, BadSamples bad,
                       const RunContext& run) {
  EditReport total;
  std::mutex mutex;
  const auto work = [&](SampleBatch& batch) {
    const EditReport part = clean_rows(batch);
    if (part.bad_rows > 0 && bad == BadSamples::refuse) refuse_bad_row(part, source.info().path);
    if (edit) edit(batch);
    const std::lock_guard lock(mutex);
    add(total, part);
  };
  edit::for_each_batch(source, "write", run, work, [&](SampleBatch& batch) { writer.append(batch); });
  total.written = writer.rows();
  return total;
}

void warn_of_bad_rows(const EditReport& report, const std::string& path, const RunContext& run) {
  if (report.bad_rows > 0) {
    run.warn(fmt::format("{}: {} of {} rows are not finite, the first is row {} (counted from 0); dropped", path,
                         report.bad_rows, report.read, *report.first_bad_row));
  }
  if (report.replaced_normals > 0) {
    run.warn(fmt::format("{}: {} of {} normals are not finite; they become 0 0 0", path, report.replaced_normals,
                         report.read));
  }
  if (report.replaced_values > 0) {
    run.warn(fmt::format("{}: {} attribute values are not finite; they become 0", path, report.replaced_values));
  }
}

namespace {

/// A column of one of several inputs, by name.
struct Named {
  std::string name;
  ScalarType type;
  std::size_t inputs = 0;  ///< that have it
  std::size_t first = 0;   ///< input it was first seen in
};

bool is_integer(ScalarType t) {
  return t != ScalarType::float32 && t != ScalarType::float64;
}

bool is_signed(ScalarType t) {
  return t == ScalarType::int8 || t == ScalarType::int16 || t == ScalarType::int32;
}

/// The smallest type that holds every value of both.
ScalarType common_type(ScalarType a, ScalarType b) {
  if (a == b) return a;
  if (!is_integer(a) || !is_integer(b))
    return fits_float(a) && fits_float(b) ? ScalarType::float32 : ScalarType::float64;
  if (is_signed(a) == is_signed(b)) return byte_size(a) > byte_size(b) ? a : b;
  const int bytes =
      std::max(is_signed(a) ? byte_size(a) : 2 * byte_size(a), is_signed(b) ? byte_size(b) : 2 * byte_size(b));
  return bytes == 2 ? ScalarType::int16 : bytes == 4 ? ScalarType::int32 : ScalarType::float64;
}

class Union {
 public:
  Union(std::vector<std::string> files, MixedAttributes mixed) : files_(std::move(files)), mixed_(mixed) {}

  void add(std::size_t input, const AttributeSpec& spec) {
    const auto at = std::find_if(columns_.begin(), columns_.end(), [&](const Named& c) { return c.name == spec.name; });
    if (at == columns_.end()) {
      columns_.push_back({spec.name, spec.type, 1, input});
      return;
    }
    ++at->inputs;
    if (at->type == spec.type) return;
    if (mixed_ == MixedAttributes::refuse || is_colour(spec.name)) {
      throw Error(ExitCode::unreadable,
                  fmt::format("{}: '{}' is {}, in {} it is {}; {}", files_[input], spec.name, ply_name(spec.type),
                              files_[at->first], ply_name(at->type),
                              is_colour(spec.name) ? "bring the colours to one type first"
                                                   : "--mixed fill takes a type that holds both"));
    }
    at->type = common_type(at->type, spec.type);
  }

  /// For what an input has or has not as a whole: normals, radius, quality.
  [[nodiscard]] bool keep(const char* what, const std::vector<bool>& has, bool can_fill) const {
    const auto with = std::find(has.begin(), has.end(), true), without = std::find(has.begin(), has.end(), false);
    if (without == has.end()) return true;
    if (with == has.end()) return false;
    require_mixed(what, static_cast<std::size_t>(without - has.begin()), static_cast<std::size_t>(with - has.begin()));
    return mixed_ == MixedAttributes::fill && can_fill;
  }

  [[nodiscard]] AttributeLayout layout(const std::vector<std::vector<std::string>>& names) const {
    AttributeLayout out;
    for (const Named& column : columns_) {
      if (column.inputs < files_.size()) {
        const auto lacks = std::find_if(names.begin(), names.end(), [&](const auto& list) {
          return std::find(list.begin(), list.end(), column.name) == list.end();
        });
        require_mixed(column.name.c_str(), static_cast<std::size_t>(lacks - names.begin()), column.first);
        if (mixed_ == MixedAttributes::intersect) continue;
      }
      out.push_back({column.name, column.type});
    }
    return out;
  }

 private:
  void require_mixed(const char* what, std::size_t without, std::size_t with) const {
    if (mixed_ != MixedAttributes::refuse) return;
    throw Error(ExitCode::unreadable,
                fmt::format("{}: has no {}, {} has; --mixed fill puts 0 there, --mixed intersect leaves it out",
                            files_[without], what, files_[with]));
  }

  std::vector<std::string> files_;
  MixedAttributes mixed_;
  std::vector<Named> columns_;
};

/// Where each column of the merged layout stands in an input's.
std::vector<std::optional<std::size_t>> places(const AttributeLayout& merged, const AttributeLayout& own) {
  std::vector<std::optional<std::size_t>> out;
  for (const AttributeSpec& spec : merged) {
    const auto at = std::find_if(own.begin(), own.end(), [&](const AttributeSpec& o) { return o.name == spec.name; });
    out.push_back(at == own.end() ? std::nullopt : std::optional(static_cast<std::size_t>(at - own.begin())));
  }
  return out;
}

std::vector<std::string> names_of(const AttributeLayout& layout) {
  std::vector<std::string> names;
  names.reserve(layout.size());
  for (const AttributeSpec& spec : layout) names.push_back(spec.name);
  return names;
}

}  // namespace

PointColumns merged_columns(const std::vector<const PointSourceInfo*>& inputs, MixedAttributes mixed) {
  if (inputs.empty()) throw Error(ExitCode::usage, "merge: nothing to merge");
  std::vector<std::string> files;
  std::vector<std::vector<std::string>> names;
  std::vector<bool> normals, radius, quality;
  PointColumns out;
  for (const PointSourceInfo* info : inputs) {
    files.push_back(info->path);
    names.push_back(names_of(info->attributes));
    normals.push_back(info->has_normals);
    radius.push_back(info->has_radius);
    quality.push_back(info->has_quality);
    out.double_positions = out.double_positions || info->double_precision;
    if (out.radius.empty()) out.radius = info->radius_name;
    if (out.quality.empty()) out.quality = info->quality_name;
  }
  Union columns(files, mixed);
  for (std::size_t i = 0; i < inputs.size(); ++i)
    for (const AttributeSpec& spec : inputs[i]->attributes) columns.add(i, spec);
  out.normals = columns.keep("normals (nx ny nz)", normals, false);
  if (!columns.keep("radius", radius, false)) out.radius.clear();
  if (!columns.keep("quality", quality, true)) out.quality.clear();
  out.attributes = columns.layout(names);
  return out;
}

EditReport append_points(PointSource& source, PointsWriter& writer, BadSamples bad, const RunContext& run) {
  const PointColumns& columns = writer.columns();
  const auto from = places(columns.attributes, source.info().attributes);
  const std::uint64_t before = writer.rows();
  const auto arrange = [&](SampleBatch& batch) {
    std::vector<std::vector<float>> attributes(from.size());
    std::vector<std::vector<double>> exact(from.size());
    for (std::size_t a = 0; a < from.size(); ++a) {
      if (!from[a]) {
        attributes[a].assign(batch.size(), 0);
        continue;
      }
      attributes[a] = std::move(batch.attributes[*from[a]]);
      if (*from[a] < batch.exact.size()) exact[a] = std::move(batch.exact[*from[a]]);
    }
    batch.attributes = std::move(attributes);
    batch.exact = std::move(exact);
    if (!columns.quality.empty() && batch.quality.empty()) batch.quality.assign(batch.size(), 1);
  };
  EditReport report = edit_points(source, writer, arrange, bad, run);
  report.written = writer.rows() - before;
  return report;
}

TriangleMesh merge_meshes(std::vector<TriangleMesh> meshes, const std::vector<std::string>& names,
                          MixedAttributes mixed) {
  if (meshes.empty()) throw Error(ExitCode::usage, "merge: nothing to merge");
  Union columns(names, mixed);
  std::vector<bool> normals;
  std::vector<std::vector<std::string>> attribute_names;
  std::uint64_t vertices = 0;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    for (const AttributeSpec& spec : meshes[i].layout) columns.add(i, spec);
    normals.push_back(!meshes[i].normals.empty());
    attribute_names.push_back(names_of(meshes[i].layout));
    vertices += meshes[i].positions.size();
  }
  if (vertices > std::numeric_limits<std::uint32_t>::max())
    throw Error(ExitCode::budget,
                "merge: together the meshes have more than 4294967295 vertices, the most that 32-bit "
                "indices can name");
  const bool with_normals = columns.keep("normals", normals, false);
  TriangleMesh out;
  out.layout = columns.layout(attribute_names);
  out.attributes.resize(out.layout.size());
  for (TriangleMesh& mesh : meshes) {
    const auto first = static_cast<std::uint32_t>(out.positions.size());
    out.positions.insert(out.positions.end(), mesh.positions.begin(), mesh.positions.end());
    if (with_normals) out.normals.insert(out.normals.end(), mesh.normals.begin(), mesh.normals.end());
    const auto from = places(out.layout, mesh.layout);
    for (std::size_t a = 0; a < from.size(); ++a) {
      if (from[a]) {
        const auto& values = mesh.attributes[*from[a]];
        out.attributes[a].insert(out.attributes[a].end(), values.begin(), values.end());
      }
      out.attributes[a].resize(out.positions.size());
    }
    for (const auto& t : mesh.triangles) out.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    mesh = {};  // its memory is needed no longer
  }
  return out;
}

}  // namespace lamina
