#include "ranks/deal_rows.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "lamina/error.h"

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

}  // namespace lamina::ranks
