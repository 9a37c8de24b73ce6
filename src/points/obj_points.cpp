#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>

#include "base/number.h"
#include "lamina/error.h"
#include "points/formats.h"
#include "points/point_columns.h"
#include "points/text_rows.h"

namespace lamina {
namespace {

enum class Line { other, vertex, normal, face };

Line kind_of(std::string_view line) {
  while (!line.empty() && is_space(line.front())) line.remove_prefix(1);
  if (line.size() < 3) return Line::other;
  if (line[0] == 'v' && is_space(line[1])) return Line::vertex;
  if (line[0] == 'v' && line[1] == 'n' && is_space(line[2])) return Line::normal;
  if (line[0] == 'f' && is_space(line[1])) return Line::face;
  return Line::other;
}

std::string_view without_keyword(std::string_view line) {
  while (is_space(line.front())) line.remove_prefix(1);
  while (!is_space(line.front())) line.remove_prefix(1);
  return line;
}

/// Whether each corner of the face has the normal with its vertex's number, or none.
bool pairs_alike(std::string_view line) {
  std::vector<std::string_view> corners;
  split_line(without_keyword(line), kBlanks, corners);
  return std::all_of(corners.begin(), corners.end(), [](std::string_view corner) {
    const std::size_t first = corner.find('/');
    const std::size_t last = corner.rfind('/');
    return first == last || corner.substr(0, first) == corner.substr(last + 1);
  });
}

/// What is on the vertices' lines, going by some of them.
class VertexColumns {
 public:
  void take(const InputFile& file, std::string_view line, std::uint64_t number) {
    split_line(without_keyword(line), kBlanks, words_);
    if (columns_ == 0) columns_ = words_.size();
    if (columns_ < 3 || columns_ == 5 || columns_ > 7) {
      throw Error(ExitCode::unreadable,
                  fmt::format("{}, line {}: {} values on a vertex; x y z [w] or x y z r g b [a] expected", file.name,
                              number, columns_));
    }
    for (std::size_t c = 3; c < words_.size(); ++c) {
      double value = 0;
      if (parse_number(words_[c].data(), words_[c].data() + words_[c].size(), value) == nullptr) continue;
      highest_ = std::max(highest_, value);
      whole_ = whole_ && words_[c].find_first_not_of("0123456789") == std::string_view::npos;
    }
    const auto digits = [](std::string_view w) {
      return std::count_if(w.begin(), w.end(), [](char c) { return c >= '0' && c <= '9'; });
    };
    constexpr long kFloatDigits = 8;
    for (const std::string_view word : words_) long_numbers_ = long_numbers_ || digits(word) > kFloatDigits;
  }

  [[nodiscard]] std::vector<PointColumn> found() const {
    const ScalarType position = long_numbers_ ? ScalarType::float64 : ScalarType::float32;
    std::vector<PointColumn> columns{{"x", position}, {"y", position}, {"z", position}};
    if (columns_ == 4) {
      columns.push_back({"w"});
      columns.back().role = Role::skipped;
    }
    const bool unit = highest_ <= 1 && (!whole_ || highest_ == 1);
    const ScalarType colour = unit ? ScalarType::float32 : highest_ <= 255 ? ScalarType::uint8 : ScalarType::uint16;
    constexpr std::array kColours{"red", "green", "blue", "alpha"};
    for (std::size_t c = 3; c < columns_ && columns_ > 4; ++c) columns.push_back({kColours[c - 3], colour});
    return columns;
  }

 private:
  std::vector<std::string_view> words_;
  std::size_t columns_ = 0;
  double highest_ = 0;
  bool whole_ = true;
  bool long_numbers_ = false;
};

class ObjPoints final : public PointSource {
 public:
  ObjPoints(InputFile file, const std::string& path) : file_(std::move(file)), line_end_(line_end_of(file_)) {
    info_.path = path;
    info_.random_access = true;
    std::vector<PointColumn> columns = index_lines();
    info_.count = vertices_.count();
    std::vector<PointColumn> all = columns;
    if (with_normals_) {
      for (const char* name : {"nx", "ny", "nz"}) all.push_back({name});
    }
    give_roles(all, info_, file_.name, "value");
    std::copy(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(columns.size()), columns.begin());
    const std::vector<PointColumn> normals(all.begin() + static_cast<std::ptrdiff_t>(columns.size()), all.end());
    vertex_parser_.emplace(std::move(columns), kBlanks, "; colours of one file must be of one kind");
    normal_parser_.emplace(normals, kBlanks, "");
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    read_lines(*vertex_parser_, vertices_, Line::vertex, rows, out);
    if (with_normals_) read_lines(*normal_parser_, normals_, Line::normal, rows, out);
  }

 private:
  void read_lines(const RowParser& parser, const RowIndex& index, Line kind, RowRange rows, SampleBatch& out) const {
    const std::vector<ColumnTarget> targets = prepare_batch(info_, parser.columns(), rows, out);
    for_rows(
        file_, line_end_, index, rows, [&](std::string_view line) { return kind_of(line) == kind; },
        [&](std::string_view line, std::uint64_t number, std::size_t i) {
          parser.parse(file_, without_keyword(line), number, i, targets);
        });
  }

  /// Counts and places the lines; the columns come from the first thousand vertices and then every thousandth.
  std::vector<PointColumn> index_lines() {
    constexpr std::uint64_t kSome = 1000;
    VertexColumns columns;
    LineReader lines(file_, 0, 0, line_end_);
    std::string_view line;
    bool alike = true;
    while (lines.next(line)) {
      switch (kind_of(line)) {
        case Line::vertex:
          if (vertices_.count() < kSome || vertices_.count() % kSome == 0) columns.take(file_, line, lines.line());
          vertices_.add(lines);
          break;
        case Line::normal:
          normals_.add(lines);
          break;
        case Line::face:
          alike = alike && pairs_alike(line);
          break;
        case Line::other:
          break;
      }
    }
    if (vertices_.count() == 0) {
      throw Error(ExitCode::unreadable, fmt::format("{}: holds no vertices (lines that begin with v)", file_.name));
    }
    with_normals_ = normals_.count() == vertices_.count() && alike;
    if (normals_.count() > 0 && !with_normals_) {
      info_.remarks.push_back(fmt::format("{}: its normals are left out: {}", file_.name,
                                          alike ? fmt::format("{} for {} vertices", normals_.count(), vertices_.count())
                                                : "the faces give vertices the normals of others"));
    }
    return columns.found();
  }

  InputFile file_;
  char line_end_;
  RowIndex vertices_, normals_;
  bool with_normals_ = false;
  std::optional<RowParser> vertex_parser_, normal_parser_;
};

}  // namespace

std::unique_ptr<PointSource> open_obj(InputFile file, const std::string& path) {
  return std::make_unique<ObjPoints>(std::move(file), path);
}

}  // namespace lamina
