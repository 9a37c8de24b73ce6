#include "points/formats.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "base/number.h"
#include "lamina/error.h"
#include "points/input_file.h"

namespace lamina {
namespace {

constexpr std::size_t kSelectBlock = 1 << 12;  ///< rows whose kept ones are counted together

bool holds(PointCondition::Relation relation, double a, double b) {
  switch (relation) {
    case PointCondition::Relation::less:
      return a < b;
    case PointCondition::Relation::at_most:
      return a <= b;
    case PointCondition::Relation::equal:
      return a == b;
    case PointCondition::Relation::not_equal:
      return a != b;
    case PointCondition::Relation::at_least:
      return a >= b;
    case PointCondition::Relation::more:
      return a > b;
  }
  return false;
}

using Mask = std::vector<std::uint8_t>;  ///< by row: whether it stays

/// The selection as tests of a batch.
class RowTest {
 public:
  RowTest(const PointSource& source, const PointSelection& selection)
      : selection_(selection), hidden_(dynamic_cast<const HiddenValues*>(&source)) {
    const PointSourceInfo& info = source.info();
    for (const PointCondition& condition : selection.where)
      conditions_.push_back({condition, place_of(condition, info)});
    const bool classes = hidden_ != nullptr && hidden_->has_hidden("classification");
    const auto refuse = [&](const char* option) {
      throw Error(ExitCode::usage,
                  fmt::format("{}: has no classes and returns, which {} asks for; they are LAS's. --where "
                              "selects by other values",
                              info.path, option));
    };
    if (!classes && !selection.keep_classes.empty()) refuse("--keep-class");
    if (!classes && selection.returns != PointSelection::Returns::all) refuse("--returns");
    if (!classes && (selection.resolution)) {
      throw Error(ExitCode::usage,
                  fmt::format("{}: has no octree to take levels of; --resolution is for COPC", info.path));
    }
    if (classes && drops_any(hidden_->class_counts())) class_ = hidden_place("classification");
    if (classes && selection.returns != PointSelection::Returns::all) {
      return_ = hidden_place("return_number");
      returns_ = hidden_place("number_of_returns");
    }
  }

  [[nodiscard]] bool takes_all() const { return conditions_.empty() && !class_ && !return_; }
  [[nodiscard]] bool needs_batch() const {
    return std::any_of(conditions_.begin(), conditions_.end(), [](const Test& t) { return t.from != From::hidden; });
  }

  /// The rows that stay. `batch` holds them where needs_batch().
  [[nodiscard]] Mask judge(RowRange rows, const SampleBatch& batch) const {
    std::vector<std::vector<double>> values;
    if (!names_.empty()) hidden_->read_hidden(names_, rows, values);
    Mask stays(rows.count, 1);
    for (const Test& test : conditions_) {
      const auto apply = [&](const auto& of) {
        for (std::size_t i = 0; i < rows.count; ++i) {
          if (!holds(test.relation, static_cast<double>(of[i]), test.value)) stays[i] = 0;
        }
      };
      if (test.from == From::hidden) {
        apply(values[test.place]);
      } else if (test.from == From::position) {
        apply(*std::array{&batch.x, &batch.y, &batch.z}[test.place]);
      } else if (test.place < batch.exact.size() && !batch.exact[test.place].empty()) {
        apply(batch.exact[test.place]);
      } else {
        apply(batch.attributes[test.place]);
      }
    }
    for (std::size_t i = 0; class_ && i < rows.count; ++i) {
      if (!keeps_class(static_cast<int>(values[*class_][i]))) stays[i] = 0;
    }
    for (std::size_t i = 0; return_ && i < rows.count; ++i) {
      const bool first = selection_.returns == PointSelection::Returns::first;
      if (first ? values[*return_][i] > 1 : values[*return_][i] < values[*returns_][i]) stays[i] = 0;
    }
    return stays;
  }

  /// What is not taken, for a remark.
  [[nodiscard]] std::string words() const {
    const bool noise_only = conditions_.empty() && !return_ && selection_.keep_classes.empty() &&
                            std::equal(selection_.drop_classes.begin(), selection_.drop_classes.end(),
                                       PointSelection::kNoise.begin(), PointSelection::kNoise.end());
    return noise_only ? "left out as noise (classes 7 and 18); --drop-class none keeps them" : "not selected";
  }

 private:
  enum class From { attribute, position, hidden };
  struct Place {
    From from;
    std::size_t place;
  };
  struct Test {
    Test(const PointCondition& condition, const Place& at)
        : relation(condition.relation), value(condition.value), from(at.from), place(at.place) {}
    PointCondition::Relation relation;
    double value;
    From from;
    std::size_t place;
  };

  Place place_of(const PointCondition& condition, const PointSourceInfo& info) {
    const std::string& name = condition.name;
    std::string known = "x, y, z";
    for (std::size_t a = 0; a < info.attributes.size(); ++a) {
      if (info.attributes[a].name == name) return {From::attribute, a};
      known += ", " + info.attributes[a].name;
    }
    if (name == "x" || name == "y" || name == "z") return {From::position, static_cast<std::size_t>(name[0] - 'x')};
    if (hidden_ != nullptr && hidden_->has_hidden(name)) return {From::hidden, hidden_place(name)};
    throw Error(ExitCode::usage,
                fmt::format("{}: its points have no {} to select by; they have {}{}", info.path, quoted_word(name),
                            known, hidden_ != nullptr ? ", and classification, return_number and the like" : ""));
  }

  std::size_t hidden_place(const std::string& name) {
    const auto known = std::find(names_.begin(), names_.end(), name);
    const auto place = static_cast<std::size_t>(known - names_.begin());
    if (known == names_.end()) names_.push_back(name);
    return place;
  }

  [[nodiscard]] bool drops_any(const std::vector<std::uint64_t>& counts) const {
    for (std::size_t number = 0; number < counts.size(); ++number) {
      if (counts[number] > 0 && !keeps_class(static_cast<int>(number))) return true;
    }
    return false;
  }

  [[nodiscard]] bool keeps_class(int number) const {
    const auto is_in = [&](const std::vector<int>& list) {
      return std::find(list.begin(), list.end(), number) != list.end();
    };
    // Who names a class to keep wants it, also if it is noise.
    if (!selection_.keep_classes.empty()) return is_in(selection_.keep_classes);
    return !is_in(selection_.drop_classes);
  }

  PointSelection selection_;
  const HiddenValues* hidden_;
  std::vector<std::string> names_;  ///< hidden values to read
  std::vector<Test> conditions_;
  std::optional<std::size_t> class_, return_, returns_;  ///< places among the hidden values
};

/// Moves `count` rows from the first-th on to `to`, whose other rows go; all before them go from `from`, too.
void cut_rows(std::size_t first, std::size_t count, SampleBatch& from, SampleBatch& to) {
  for_columns(from, to, [&](auto& values, auto& out) {
    if (values.empty()) return out.clear();
    const auto begin = values.begin() + static_cast<std::ptrdiff_t>(first);
    const auto end = begin + static_cast<std::ptrdiff_t>(count);
    out.assign(begin, end);
    values.erase(values.begin(), end);
  });
}

void append_rows(const SampleBatch& from, SampleBatch& to) {
  for_columns(from, to, [](const auto& values, auto& out) { out.insert(out.end(), values.begin(), values.end()); });
}

/// How many rows stay.
struct KeptRows {
  std::vector<std::uint64_t> before;       ///< each block; and of all
  std::vector<std::uint64_t> scan_starts;  ///< before the source's scans
};

KeptRows count_kept(PointSource& source, const RowTest& test) {
  const PointSourceInfo& info = source.info();
  const std::uint64_t blocks = (info.count + kSelectBlock - 1) / kSelectBlock;
  KeptRows kept{std::vector<std::uint64_t>(static_cast<std::size_t>(blocks) + 1, 0),
                std::vector<std::uint64_t>(info.scans.size(), 0)};
  const auto look = [&](std::uint64_t block) {
    SampleBatch batch;
    const std::uint64_t first = block * kSelectBlock;
    if (test.needs_batch()) source.read(first, kSelectBlock, batch);
    const RowRange rows = rows_there(info, first, kSelectBlock);
    const Mask stays = test.judge(rows, batch);
    for (std::size_t s = 0; s < info.scans.size(); ++s) {
      const std::uint64_t start = info.scans[s].first;
      if (start < first || start >= first + rows.count) continue;
      kept.scan_starts[s] = static_cast<std::uint64_t>(
          std::count(stays.begin(), stays.begin() + static_cast<std::ptrdiff_t>(start - first), 1));
    }
    kept.before[static_cast<std::size_t>(block) + 1] =
        static_cast<std::uint64_t>(std::count(stays.begin(), stays.end(), 1));
  };
  if (info.random_access) {
    tbb::parallel_for(std::uint64_t{0}, blocks, look);
  } else {
    for (std::uint64_t block = 0; block < blocks; ++block) look(block);
  }
  for (std::size_t i = 1; i < kept.before.size(); ++i) kept.before[i] += kept.before[i - 1];
  for (std::size_t s = 0; s < info.scans.size(); ++s) {
    kept.scan_starts[s] += kept.before[static_cast<std::size_t>(std::min(info.scans[s].first / kSelectBlock, blocks))];
  }
  return kept;
}

/// Grids of organised scans are lost: their rows are no longer all there.
class SelectedPoints final : public PointSource {
 public:
  SelectedPoints(std::unique_ptr<PointSource> source, RowTest test, KeptRows kept)
      : source_(std::move(source)), test_(std::move(test)), kept_before_(std::move(kept.before)) {
    info_ = source_->info();
    info_.count = kept_before_.back();
    for (std::size_t s = 0; s < info_.scans.size(); ++s) info_.scans[s].first = kept.scan_starts[s];
    info_.remarks.push_back(fmt::format("{}: {} of {} points {}", info_.path, source_->info().count - info_.count,
                                        source_->info().count, test_.words()));
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    if (info_.random_access) {
      SampleBatch there;
      std::size_t begin = 0;
      if (rows.count > 0) begin = block_of(rows.first);
      const std::size_t end = rows.count > 0 ? block_of(rows.first + rows.count - 1) + 1 : 0;
      read_kept(begin * kSelectBlock, (end - begin) * kSelectBlock, there);
      cut_rows(static_cast<std::size_t>(rows.first - (rows.count > 0 ? kept_before_[begin] : rows.first)), rows.count,
               there, out);
    } else {
      read_on(rows, out);
    }
    out.first = rows.first;
  }

 private:
  [[nodiscard]] std::size_t block_of(std::uint64_t row) const {
    return static_cast<std::size_t>(std::upper_bound(kept_before_.begin(), kept_before_.end(), row) -
                                    kept_before_.begin() - 1);
  }

  void read_kept(std::uint64_t first, std::size_t count, SampleBatch& out) const {
    source_->read(first, count, out);
    keep_rows(out, test_.judge({first, out.size()}, out));
  }

  /// What was read of the source and is not yet wanted waits.
  void read_on(RowRange rows, SampleBatch& out) {
    if (rows.first == 0) {
      waiting_ = {};
      next_ = 0;
    }
    SampleBatch piece;
    while (waiting_.size() < rows.count || waiting_.attributes.size() < info_.attributes.size()) {
      read_kept(next_, kSelectBlock, piece);
      next_ += kSelectBlock;
      append_rows(piece, waiting_);
    }
    cut_rows(0, rows.count, waiting_, out);
  }

  std::unique_ptr<PointSource> source_;
  RowTest test_;
  std::vector<std::uint64_t> kept_before_;  ///< by block, and the number of all
  SampleBatch waiting_;
  std::uint64_t next_ = 0;
};

}  // namespace

PointCondition parse_condition(std::string_view text) {
  using Relation = PointCondition::Relation;
  constexpr std::array<std::pair<std::string_view, Relation>, 7> kRelations{{{"<=", Relation::at_most},
                                                                             {">=", Relation::at_least},
                                                                             {"==", Relation::equal},
                                                                             {"!=", Relation::not_equal},
                                                                             {"<", Relation::less},
                                                                             {">", Relation::more},
                                                                             {"=", Relation::equal}}};
  const std::size_t at = std::min(text.find_first_of("<>=!"), text.size());
  for (const auto& [word, relation] : kRelations) {
    if (!text.substr(at).starts_with(word)) continue;
    PointCondition condition{std::string(trimmed(text.substr(0, at))), relation};
    if (!condition.name.empty() && is_number(trimmed(text.substr(at + word.size())), condition.value)) return condition;
  }
  throw Error(ExitCode::usage,
              fmt::format("{} is no condition; one is a name, one of < <= = != >= > and a number, as in "
                          "'intensity>10'",
                          quoted_word(text)));
}

std::string to_string(const PointSelection& selection) {
  std::string text = fmt::format("keep {} drop {} returns {}", fmt::join(selection.keep_classes, ","),
                                 fmt::join(selection.drop_classes, ","), static_cast<int>(selection.returns));
  for (const PointCondition& c : selection.where) {
    text += fmt::format(" where '{}' {} {}", c.name, static_cast<int>(c.relation), c.value);
  }
  if (selection.resolution) text += fmt::format(" resolution {}", *selection.resolution);
  return text;
}

std::unique_ptr<PointSource> select_points(std::unique_ptr<PointSource> source, const PointSelection& selection) {
  RowTest test(*source, selection);
  if (test.takes_all() || source->info().count == 0) return source;
  KeptRows kept = count_kept(*source, test);
  if (kept.before.back() == source->info().count) return source;
  return std::make_unique<SelectedPoints>(std::move(source), std::move(test), std::move(kept));
}

}  // namespace lamina
