#include "ranks/together.h"

#include <algorithm>
#include <array>
#include <exception>
#include <limits>
#include <utility>

#include "lamina/error.h"
#include "store/block_codec.h"
#include "store/slab_store.h"

namespace lamina::ranks {
namespace {

constexpr std::size_t kNoBucket = std::numeric_limits<std::size_t>::max();

/// Before each block.
struct BlockHead {
  std::uint64_t bucket;
  std::uint32_t count, bytes;
};

void append_block(const SlabStore& store, std::size_t bucket, const BlockEntry& block, Bytes& out) {
  const BlockHead head{bucket, block.count, block.bytes};
  const std::size_t at = out.size();
  out.resize(at + sizeof head + block.bytes);
  std::memcpy(out.data() + at, &head, sizeof head);
  read_block(store, bucket, block, std::span(out).subspan(at + sizeof head));
}

/// Hands over head and block, in order.
template <class Take>
void take_blocks(std::span<const std::byte> bytes, const Take& take) {
  while (!bytes.empty()) {
    BlockHead head{};
    if (bytes.size() >= sizeof head) std::memcpy(&head, bytes.data(), sizeof head);
    if (bytes.size() < sizeof head || head.bytes > bytes.size() - sizeof head)
      throw Error(ExitCode::internal, "ranks: a block arrived cut short");
    take(head, CodedBlock{head.count, bytes.subspan(sizeof head, head.bytes)});
    bytes = bytes.subspan(sizeof head + head.bytes);
  }
}

/// What a rank answers when it is asked for a bucket: its blocks, or why it cannot.
Bytes answer(const SlabStore& store, std::size_t bucket) {
  Bytes blocks;
  Packer words;
  try {
    for (const BlockEntry& block : blocks_of(store, bucket)) append_block(store, bucket, block, blocks);
    words.put(true);
    words.put(blocks);
  } catch (const Error& error) {
    words.put(false);
    words.put(error.code());
    words.put(std::string(error.what()));
  }
  return words.take();
}

void read_everywhere(Ranks& ranks, const SlabStore& store, std::size_t bucket, LocalSamples& out) {
  Packer question;
  question.put(bucket);
  Bytes bytes = question.take();
  ranks.broadcast(bytes);
  std::vector<Bytes> parts;
  for (const Bytes& said : ranks.gather(answer(store, bucket))) {
    Unpacker in(said);
    if (!in.get<bool>()) {
      const auto code = in.get<ExitCode>();
      throw Error(code, in.get_text());
    }
    parts.push_back(in.get_list<std::byte>());
  }
  std::vector<CodedBlock> blocks;
  for (const Bytes& part : parts) {
    take_blocks(part, [&](const BlockHead&, const CodedBlock& block) { blocks.push_back(block); });
  }
  decode_blocks(store.layout(), blocks, out);
}

/// Gives what rank 0 asks for until it asks no more.
void serve(Ranks& ranks, const SlabStore& store) {
  for (;;) {
    Bytes bytes;
    ranks.broadcast(bytes);
    const auto bucket = Unpacker(bytes).get<std::size_t>();
    if (bucket == kNoBucket) return;
    ranks.gather(answer(store, bucket));
  }
}

/// This rank's blocks for another one, from where the last message ended.
class Outgoing {
 public:
  Outgoing(const SlabStore& store, const BucketSpan& wanted) : store_(store), wanted_(wanted), bucket_(wanted.begin) {
    skip_empty();
  }
  [[nodiscard]] bool done() const { return bucket_ >= wanted_.end; }
  /// Blocks until they are `most` bytes or more.
  void fill(Bytes& out, std::size_t most) {
    while (!done() && out.size() < most) {
      append_block(store_, bucket_, blocks_of(store_, bucket_)[block_], out);
      ++block_;
      skip_empty();
    }
  }

 private:
  void skip_empty() {
    while (!done() && block_ == blocks_of(store_, bucket_).size()) {
      ++bucket_;
      block_ = 0;
    }
  }
  const SlabStore& store_;
  BucketSpan wanted_;
  std::size_t bucket_, block_ = 0;
};

}  // namespace

CloudSurvey survey_together(Ranks& ranks, const SurfaceSettings& settings, const SlabStore& store) {
  CloudSurvey survey;
  std::exception_ptr failure;
  if (!ranks.first()) {
    serve(ranks, store);
  } else {
    try {
      const ReadBucket read = [&](std::size_t bucket, LocalSamples& out) {
        read_everywhere(ranks, store, bucket, out);
      };
      survey = survey_cloud(settings, store, read);
    } catch (...) {
      failure = std::current_exception();
    }
    Packer end;
    end.put(kNoBucket);
    Bytes bytes = end.take();
    ranks.broadcast(bytes);
  }
  ranks.together([&] {
    if (failure) std::rethrow_exception(failure);
  });
  Packer found;
  found.put(survey.radii);
  found.put(survey.noisy);
  found.put(survey.support.places);
  found.put(survey.support.lines);
  Bytes bytes = found.take();
  ranks.broadcast(bytes);
  Unpacker in(bytes);
  survey.radii = in.get<RadiusSurvey>();
  survey.noisy = in.get<bool>();
  survey.support.places = in.get_list<SupportPlace>();
  survey.support.lines = in.get<bool>();
  return survey;
}

SlabStore gather_buckets(Ranks& ranks, const SlabStore& store, const std::vector<BucketSpan>& wanted,
                         const std::string& directory, const RunContext& run) {
  const auto size = static_cast<std::size_t>(ranks.size()), own = static_cast<std::size_t>(ranks.rank());
  constexpr std::size_t kRound = 4 << 20, kLeast = 64 << 10;
  const std::size_t most = std::max(kLeast, kRound / size);  // bytes a rank sends to another in a round
  std::optional<StoreGatherer> gatherer;
  std::uint64_t needed = 0, here = 0;
  const auto keep = [&](std::size_t source, std::span<const std::byte> bytes) {
    take_blocks(bytes, [&](const BlockHead& head, const CodedBlock& block) {
      gatherer->add(head.bucket, source, block);
      here += head.count;
    });
  };
  ranks.together([&] {
    gatherer.emplace(store.layout(), directory, bucket_shares(store), size);
    for (std::size_t b = wanted[own].begin; b < wanted[own].end; ++b) needed += store.count(b);
  });
  std::vector<Outgoing> outgoing;
  outgoing.reserve(size);
  for (const BucketSpan& span : wanted) outgoing.emplace_back(store, span);
  std::exception_ptr failure;
  const auto attempt = [&](const auto& work) {
    if (failure) return;
    try {
      work();
    } catch (...) {
      failure = std::current_exception();
    }
  };
  std::vector<Bytes> to(size), from;
  for (bool more = true; more;) {
    attempt([&] {
      for (std::size_t r = 0; r < size; ++r) {
        to[r].clear();
        outgoing[r].fill(to[r], most);
      }
    });
    ranks.exchange(to, from);
    attempt([&] {
      for (std::size_t r = 0; r < size; ++r) keep(r, r == own ? to[r] : from[r]);
      if (run.progress) run.progress({"share", here, needed, 0, 0});
      if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    });
    const bool done = std::all_of(outgoing.begin(), outgoing.end(), [](const Outgoing& o) { return o.done(); });
    std::array<std::int64_t, 2> state{done ? 0 : 1, failure ? 1 : 0};
    ranks.most(state);
    more = state[0] != 0 && state[1] == 0;
  }
  std::optional<SlabStore> gathered;
  ranks.together([&] {
    if (failure) std::rethrow_exception(failure);
    gathered.emplace(gatherer->finish());
  });
  return std::move(*gathered);
}

}  // namespace lamina::ranks
