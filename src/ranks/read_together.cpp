#include "ranks/together.h"

#include <algorithm>
#include <array>
#include <exception>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "lamina/error.h"
#include "points/formats.h"
#include "points/input_file.h"
#include "ranks/ranks.h"
#include "reconstruct/stored_cloud.h"
#include "store/block_codec.h"
#include "store/slab_store.h"

namespace lamina::ranks {

namespace {

/// Rows wanted next; none: the rank has ended.
struct Wish {
  std::uint64_t first = 0, count = 0;
};

Bytes pack(const SampleBatch& batch) {
  Packer out;
  out.put(true);
  out.put(batch.first);
  for (const auto* values : {&batch.x, &batch.y, &batch.z}) out.put(*values);
  for (const auto* values : {&batch.nx, &batch.ny, &batch.nz, &batch.radius, &batch.quality}) out.put(*values);
  out.put(batch.attributes.size());
  for (const auto& values : batch.attributes) out.put(values);
  return out.take();
}

/// False: there are none.
bool unpack(const Bytes& bytes, SampleBatch& batch) {
  Unpacker in(bytes);
  if (!in.get<bool>()) return false;
  batch.first = in.get<std::uint64_t>();
  for (auto* values : {&batch.x, &batch.y, &batch.z}) *values = in.get_list<double>();
  for (auto* values : {&batch.nx, &batch.ny, &batch.nz, &batch.radius, &batch.quality}) *values = in.get_list<float>();
  batch.attributes.resize(in.get<std::size_t>());
  for (auto& values : batch.attributes) values = in.get_list<float>();
  batch.exact.clear();
  return true;
}

void ask(Ranks& ranks, const Wish& wish) {
  Packer out;
  out.put(wish);
  ranks.send(0, out.take());
}

Wish hear(Ranks& ranks, int from) {
  const Bytes bytes = ranks.receive(from);
  return Unpacker(bytes).get<Wish>();
}

/// Serves one rank until it has ended. Returns whether it took all its rows.
bool serve(Ranks& ranks, PointSource& source, int rank, const RowSpan& rows, std::exception_ptr& failure, bool rest) {
  SampleBatch batch;
  Bytes ahead;  // the rows that follow those sent last
  std::uint64_t next = rows.first;
  const auto read = [&](std::uint64_t count) {
    ahead.clear();
    if (failure || !rest || count == 0) return;
    try {
      source.read(next, static_cast<std::size_t>(count), batch);
      ahead = pack(batch);
    } catch (...) {
      failure = std::current_exception();
    }
  };
  Packer refusal;
  refusal.put(false);
  const Bytes nothing = refusal.take();
  for (bool first = true;; first = false) {
    const Wish wish = hear(ranks, rank);
    if (wish.count == 0) break;
    if (first) read(wish.count);
    ranks.send(rank, ahead.empty() ? nothing : ahead);
    if (!ahead.empty()) next += wish.count;
    read(std::min(wish.count, rows.end - next));
  }
  return next == rows.end;
}

}  // namespace

DealtRows::DealtRows(Ranks& ranks, const PointSourceInfo& info) : ranks_(ranks) {
  info_ = info;
  info_.random_access = false;
}

void DealtRows::take(const std::function<void()>& work) {
  std::exception_ptr failure;
  try {
    work();
  } catch (...) {
    failure = std::current_exception();
  }
  ask(ranks_, {});
  if (failure) std::rethrow_exception(failure);
}

void DealtRows::read(std::uint64_t first, std::size_t count, SampleBatch& out) {
  ask(ranks_, {first, count});
  if (!unpack(ranks_.receive(0), out)) {
    ranks_.note_failure();
    throw Error(ExitCode::internal, "cancelled");
  }
  if (out.first != first || out.size() != count)
    throw Error(ExitCode::internal, "ranks: other rows were dealt than were asked for");
}

void deal_rows(Ranks& ranks, PointSource& source, const std::function<void()>& work,
               const std::function<RowSpan(int rank)>& share) {
  std::exception_ptr failure;
  try {
    work();
  } catch (...) {
    failure = std::current_exception();
  }
  bool rest = true;  // what is read in order goes on only where the rank before has taken all
  for (int rank = 1; rank < ranks.size(); ++rank) {
    const bool all = serve(ranks, source, rank, share(rank), failure, rest);
    rest = rest && (all || source.info().random_access);
  }
  if (failure) std::rethrow_exception(failure);
}

namespace {

/// Every rank can read it by itself, and pays for no more than the rows it wants.
bool can_be_shared(const SurfaceSettings& settings, const PointSourceInfo& info) {
  if (!info.random_access) return false;
  constexpr std::size_t kStart = 4096;
  const std::vector<PointInput> inputs = expand_inputs(input_names(settings));
  return std::all_of(inputs.begin(), inputs.end(), [](const PointInput& input) {
    std::error_code ignored;
    if (input.path == "-" || !std::filesystem::is_regular_file(input.path, ignored)) return false;
    const InputFile file{open_to_read(input.path), kStart, input.path};
    std::array<char, kStart> start{};
    const std::string_view bytes(start.data(), file.read(0, start.data(), start.size()));
    // Unpacked by each, or held whole by each, it would take as much again for every rank.
    return !is_gzip(bytes) && detect_format(bytes, input.path) != PointFormat::vdb;
  });
}

RowSpan share_of(std::uint64_t rows, int rank, int size) {
  // Quotient first: rows times ranks may pass 64 bits nowhere near here, but need not.
  const auto at = [&](int r) {
    const auto part = static_cast<std::uint64_t>(r), parts = static_cast<std::uint64_t>(size);
    return rows / parts * part + rows % parts * part / parts;
  };
  return {at(rank), at(rank + 1)};
}

class Reading {
 public:
  Reading(Ranks& ranks, const SurfaceSettings& settings, const std::string& directory, Job& job)
      : ranks_(ranks), settings_(settings), directory_(directory), job_(job) {}

  SharedInput read() {
    open();
    std::optional<Survey> survey;
    look([&] { survey = survey_part(*source_); });
    bool complete = false;
    if (tell(survey)) complete = fill(*survey);
    if (complete) {
      ranks_.together([&] { judge(census_, source_->info(), settings_.bad_samples, job_.run); });
    } else {
      ingested_.reset();
      look([&] { survey = survey_input(*source_, settings_.bad_samples, job_.run); });
      tell(survey);
      fill(*survey);
    }
    return {{source_->info(), frame_, std::move(*ingested_)}, rows_.end - rows_.first};
  }

 private:
  void open() {
    Packer words;
    ranks_.together([&] {
      if (!ranks_.first()) return;
      source_ = open_inputs(settings_, directory_, job_.run);
      // Normals that are found lie in a store of rank 0's, and only it knows how scans move; it deals the rows out.
      job_.watch.time("normals", [&] { source_ = choose_normals(std::move(source_), settings_, directory_, job_); });
      source_ = choose_poses(std::move(source_), settings_, job_);
      require_samples(source_->info());
      put(words, source_->info());
      words.put(!job_.stats.normals && !job_.stats.alignment.moved() && can_be_shared(settings_, source_->info()));
    });
    Bytes bytes = words.take();
    ranks_.broadcast(bytes);
    Unpacker in(bytes);
    const PointSourceInfo info = get_info(in);
    const auto shared = in.get<bool>();
    ranks_.together([&] {
      if (ranks_.first()) return;
      if (shared) {
        source_ = open_inputs(settings_, directory_, job_.run);
      } else {
        source_ = std::make_unique<DealtRows>(ranks_, info);
      }
      if (source_->info().count != info.count) {
        throw Error(ExitCode::unreadable, info.path + ": does not look the same to all ranks; they must see one file");
      }
    });
    shared_ = shared;
    rows_ = share_of(info.count, ranks_.rank(), ranks_.size());
  }

  /// On rank 0, while the others wait.
  template <class Work>
  void look(const Work& work) {
    ranks_.together([&] {
      if (ranks_.first()) job_.watch.time("survey", work);
    });
  }

  /// All know what rank 0 has found; whether it has.
  bool tell(std::optional<Survey>& survey) {
    Packer words;
    ranks_.together([&] {
      if (!ranks_.first()) return;
      words.put(survey.has_value());
      if (!survey) return;
      put(words, *survey);
      put(words, choose_frame(*survey, chosen_frame(settings_)));
    });
    Bytes bytes = words.take();
    ranks_.broadcast(bytes);
    Unpacker in(bytes);
    if (!in.get<bool>()) return false;
    survey.emplace();
    static_cast<Census&>(*survey) = get_census(in);
    frame_ = get_frame(in);
    return true;
  }

  /// Whether all samples lay where they may.
  bool fill(const Survey& survey) {
    ranks_.together([&] {
      const auto work = [&] {
        ingested_.emplace(ingest(*source_, survey, frame_, directory_, job_.run, {settings_.radius_scale, {}, rows_}));
      };
      job_.watch.time("store", [&] {
        if (shared_) {
          work();
        } else if (ranks_.first()) {
          deal_rows(ranks_, *source_, work,
                    [&](int rank) { return share_of(source_->info().count, rank, ranks_.size()); });
        } else {
          static_cast<DealtRows&>(*source_).take(work);
        }
      });
    });
    std::array<std::int64_t, 1> complete{ingested_->complete ? 1 : 0};
    ranks_.least(complete);
    if (complete[0] == 0) return false;
    add_up();
    return true;
  }

  /// What all ranks have read, in the place of what this one has.
  void add_up() {
    Extent& e = ingested_->extent;
    std::array<std::int64_t, 3> low{e.x_min, e.y_min, e.z_min}, high{e.x_max, e.y_max, e.z_max};
    ranks_.least(low);
    ranks_.most(high);
    const auto narrow = [](std::int64_t v) { return static_cast<std::int32_t>(v); };
    e = Extent{{narrow(low[0]), narrow(high[0]), narrow(low[1]), narrow(high[1])}, narrow(low[2]), narrow(high[2])};

    Packer own;
    put(own, ingested_->census);
    const std::vector<Bytes> all = ranks_.gather(own.take());
    Packer sum;
    if (ranks_.first()) {
      Census total;
      for (const Bytes& bytes : all) {
        Unpacker in(bytes);
        total.merge(get_census(in));
      }
      put(sum, total);
    }
    Bytes bytes = sum.take();
    ranks_.broadcast(bytes);
    Unpacker in(bytes);
    census_ = ingested_->census = get_census(in);

    std::vector<BucketShare> shares = bucket_shares(ingested_->store);
    std::vector<std::uint64_t> counts;
    std::vector<std::int64_t> lower, upper;
    for (const BucketShare& share : shares) {
      counts.push_back(share.count);
      lower.push_back(share.z_lower);
      upper.push_back(share.z_upper);
    }
    ranks_.sum(counts);
    ranks_.least(lower);
    ranks_.most(upper);
    for (std::size_t b = 0; b < shares.size(); ++b) shares[b] = {counts[b], narrow(lower[b]), narrow(upper[b])};
    declare_shares(ingested_->store, shares);
  }

  Ranks& ranks_;
  const SurfaceSettings& settings_;
  const std::string& directory_;
  Job& job_;
  std::unique_ptr<PointSource> source_;
  bool shared_ = true;
  RowSpan rows_{0, 0};
  Frame frame_;
  std::optional<Ingested> ingested_;
  Census census_;
};

}  // namespace

SharedInput read_together(Ranks& ranks, const SurfaceSettings& settings, const std::string& directory, Job& job) {
  return Reading(ranks, settings, directory, job).read();
}

}  // namespace lamina::ranks
