// The few things ranks do together, over MPI. mpi.h is included by ranks_mpi.cpp alone; a program built without MPI has
// no ranks (ranks_none.cpp).
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "lamina/run.h"
#include "ranks/messages.h"

namespace lamina::ranks {

/// What a rank's messages came to.
struct Traffic {
  double waited = 0;  ///< seconds, for the other ranks and for messages under way
  std::uint64_t sent = 0, received = 0;
};

/// All ranks the launcher started. Members are collective (all ranks call them, in one order) unless they say
/// otherwise. Waiting ranks sleep, for a processor may have several. One thread at a time; failed_elsewhere() may be
/// asked by another.
class Ranks {
 public:
  /// Begins MPI: once in a process. Throws Error(usage) when the program was built without MPI, or the launcher is of
  /// another MPI.
  Ranks();
  ~Ranks();  ///< ends MPI
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  [[nodiscard]] int rank() const;
  [[nodiscard]] int size() const;
  [[nodiscard]] bool first() const { return rank() == 0; }
  [[nodiscard]] const Traffic& traffic() const;

  /// Runs work that needs no other rank. When it throws on a rank, all ranks throw what the lowest of these has thrown,
  /// in the end: others are told at once (failed_elsewhere()) so that they can leave their work early.
  void together(const std::function<void()>& work);
  /// Whether another rank has failed in together(). May be asked at any time.
  [[nodiscard]] bool failed_elsewhere();

  /// What together() does for others: this rank's work has ended because of another's. At any time.
  void note_failure();

  /// From one rank to one other; not collective. Messages between two ranks come in order.
  void send(int to, const Bytes& bytes);
  Bytes receive(int from);

  /// What rank `from` has; the others' is replaced.
  void broadcast(Bytes& bytes, int from = 0);
  /// On rank 0 what each rank has, elsewhere nothing.
  std::vector<Bytes> gather(const Bytes& bytes);
  /// Element by element over all ranks.
  void sum(std::span<std::uint64_t> values);
  void least(std::span<std::int64_t> values);
  void most(std::span<std::int64_t> values);
  /// Sum over the ranks before this one.
  std::uint64_t sum_before(std::uint64_t value);
  /// to[r] goes to rank r, but for a rank's own; from[r] is what came from it. Both keep their memory.
  void exchange(const std::vector<Bytes>& to, std::vector<Bytes>& from);

 private:
  friend class SharedFile;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// One file that all ranks write (MPI-IO).
class SharedFile {
 public:
  /// Opens `path`, which is there; collective. `name`: for messages. Throws Error(budget) on all ranks when it cannot
  /// be opened on one.
  SharedFile(Ranks& ranks, const std::string& path, std::string name);
  ~SharedFile();
  SharedFile(const SharedFile&) = delete;
  SharedFile& operator=(const SharedFile&) = delete;
  /// Throws Error(budget) naming the file. Not collective.
  void write(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Collective. Throws as write(), on all ranks.
  void close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lamina::ranks
