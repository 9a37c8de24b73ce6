#ifdef LAMINA_MPI
#define OMPI_SKIP_MPICXX 1
#define MPICH_SKIP_MPICXX 1
#include <fmt/format.h>
#include <mpi.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <exception>
#include <mutex>
#include <new>
#include <thread>

#include "base/descriptor.h"
#include "base/output_file.h"
#include "lamina/error.h"
#include "lamina/ranks.h"
#include "ranks/ranks.h"

namespace lamina::ranks {
namespace {

constexpr std::size_t kLongestMessage = std::size_t{1} << 30;
constexpr int kFailedTag = 1, kDataTag = 2;

std::string mpi_message(int code) {
  std::array<char, MPI_MAX_ERROR_STRING> text{};
  int length = 0;
  MPI_Error_string(code, text.data(), &length);
  return {text.data(), static_cast<std::size_t>(length)};
}

/// Why a rank's work ended.
enum class Ending : int { done, failed, followed };  ///< followed: it stopped because another rank had failed

}  // namespace

struct Ranks::Impl {
  int rank = 0, size = 1;
  Traffic traffic;
  std::atomic<bool> told = false;  ///< another rank has failed
  std::mutex calling;              ///< held in calls of MPI that two threads may make at once
  bool agreed = false;             ///< all ranks are throwing
  bool threads_ok = true;          ///< MPI may be asked from any thread, one at a time

  void wait(std::span<MPI_Request> requests);
  void wait(MPI_Request request) { wait({&request, 1}); }
  void start_send(const Bytes& bytes, int to, std::vector<MPI_Request>& requests);
  void start_receive(Bytes& bytes, int from, std::vector<MPI_Request>& requests);
  void tell_failure() const;
};

/// Other threads may need the processor: after a while this one sleeps between looks.
void Ranks::Impl::wait(std::span<MPI_Request> requests) {
  constexpr int kLooks = 200;
  constexpr auto kNap = std::chrono::microseconds(50), kLongestNap = std::chrono::microseconds(1000);
  const auto began = std::chrono::steady_clock::now();
  auto nap = kNap;
  for (int looks = 0;; ++looks) {
    int done = 0;
    {
      const std::lock_guard lock(calling);
      MPI_Testall(static_cast<int>(requests.size()), requests.data(), &done, MPI_STATUSES_IGNORE);
    }
    if (done != 0) break;
    if (looks < kLooks) {
      ::sched_yield();
    } else {
      std::this_thread::sleep_for(nap);
      nap = std::min(2 * nap, kLongestNap);
    }
  }
  traffic.waited += std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
}

void Ranks::Impl::start_send(const Bytes& bytes, int to, std::vector<MPI_Request>& requests) {
  const std::byte* from = bytes.data();
  for (const std::size_t n : message_lengths(bytes.size(), kLongestMessage)) {
    requests.emplace_back();
    MPI_Isend(from, static_cast<int>(n), MPI_BYTE, to, kDataTag, MPI_COMM_WORLD, &requests.back());
    from += n;
  }
  traffic.sent += bytes.size();
}

void Ranks::Impl::start_receive(Bytes& bytes, int from, std::vector<MPI_Request>& requests) {
  std::byte* to = bytes.data();
  for (const std::size_t n : message_lengths(bytes.size(), kLongestMessage)) {
    requests.emplace_back();
    MPI_Irecv(to, static_cast<int>(n), MPI_BYTE, from, kDataTag, MPI_COMM_WORLD, &requests.back());
    to += n;
  }
  traffic.received += bytes.size();
}

void Ranks::Impl::tell_failure() const {
  for (int r = 0; r < size; ++r) {
    if (r == rank) continue;
    MPI_Request request = MPI_REQUEST_NULL;
    MPI_Isend(nullptr, 0, MPI_BYTE, r, kFailedTag, MPI_COMM_WORLD, &request);
    MPI_Request_free(&request);
  }
}

Ranks::Ranks() : impl_(std::make_unique<Impl>()) {
  int provided = MPI_THREAD_SINGLE;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &provided);
  impl_->threads_ok = provided >= MPI_THREAD_SERIALIZED;
  MPI_Comm_rank(MPI_COMM_WORLD, &impl_->rank);
  MPI_Comm_size(MPI_COMM_WORLD, &impl_->size);
  const int promised = launch().size;
  if (impl_->size == promised) return;
  const int size = impl_->size;
  MPI_Finalize();
  throw Error(ExitCode::usage, fmt::format("was started as one of {} processes, of which this MPI sees {}: use the "
                                           "mpirun of the MPI that the program was built with",
                                           promised, size));
}

Ranks::~Ranks() {
  // Others would wait for ever for a rank that leaves without them.
  if (std::uncaught_exceptions() > 0 && !impl_->agreed) MPI_Abort(MPI_COMM_WORLD, static_cast<int>(ExitCode::internal));
  MPI_Finalize();
}

int Ranks::rank() const {
  return impl_->rank;
}
int Ranks::size() const {
  return impl_->size;
}
const Traffic& Ranks::traffic() const {
  return impl_->traffic;
}

bool Ranks::failed_elsewhere() {
  if (impl_->told || !impl_->threads_ok) return impl_->told;
  const std::unique_lock lock(impl_->calling, std::try_to_lock);
  if (!lock.owns_lock()) return false;  // asked again soon
  int there = 0;
  MPI_Iprobe(MPI_ANY_SOURCE, kFailedTag, MPI_COMM_WORLD, &there, MPI_STATUS_IGNORE);
  if (there != 0) impl_->told = true;
  return impl_->told;
}

void Ranks::note_failure() {
  impl_->told = true;
}

void Ranks::send(int to, const Bytes& bytes) {
  std::uint64_t length = bytes.size();
  std::vector<MPI_Request> requests(1);
  {
    const std::lock_guard lock(impl_->calling);
    MPI_Isend(&length, 1, MPI_UINT64_T, to, kDataTag, MPI_COMM_WORLD, requests.data());
    impl_->start_send(bytes, to, requests);
  }
  impl_->wait(requests);
}

Bytes Ranks::receive(int from) {
  std::uint64_t length = 0;
  MPI_Request request = MPI_REQUEST_NULL;
  {
    const std::lock_guard lock(impl_->calling);
    MPI_Irecv(&length, 1, MPI_UINT64_T, from, kDataTag, MPI_COMM_WORLD, &request);
  }
  impl_->wait(request);
  Bytes bytes(length);
  std::vector<MPI_Request> requests;
  {
    const std::lock_guard lock(impl_->calling);
    impl_->start_receive(bytes, from, requests);
  }
  impl_->wait(requests);
  return bytes;
}

void Ranks::together(const std::function<void()>& work) {
  Ending ending = Ending::done;
  auto code = ExitCode::internal;
  std::string message;
  try {
    work();
  } catch (const Error& error) {
    ending = Ending::failed;
    code = error.code();
    message = error.what();
  } catch (const std::bad_alloc&) {
    ending = Ending::failed;
    code = ExitCode::budget;
    message = fmt::format("rank {}: out of memory; free some, or see --max-memory to plan the job", impl_->rank);
  } catch (const std::exception& error) {
    ending = Ending::failed;
    message = error.what();
  }
  if (ending == Ending::failed && impl_->told) ending = Ending::followed;
  if (ending == Ending::failed) impl_->tell_failure();
  // The lowest rank with an error of its own speaks, else the lowest that followed.
  const std::int64_t none = 2 * std::int64_t{impl_->size};
  std::array<std::int64_t, 1> speaker{none};
  if (ending == Ending::failed) speaker[0] = impl_->rank;
  if (ending == Ending::followed) speaker[0] = std::int64_t{impl_->size} + impl_->rank;
  least(speaker);
  if (speaker[0] == none) return;
  const auto from = static_cast<int>(speaker[0] % impl_->size);
  Packer said;
  said.put(code);
  said.put(message);
  Bytes bytes = said.take();
  broadcast(bytes, from);
  Unpacker heard(bytes);
  code = heard.get<ExitCode>();
  message = heard.get_text();
  impl_->agreed = true;
  throw Error(code, message);
}

void Ranks::broadcast(Bytes& bytes, int from) {
  std::uint64_t length = bytes.size();
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Ibcast(&length, 1, MPI_UINT64_T, from, MPI_COMM_WORLD, &request);
  impl_->wait(request);
  bytes.resize(length);
  std::byte* at = bytes.data();
  for (const std::size_t n : message_lengths(length, kLongestMessage)) {
    MPI_Ibcast(at, static_cast<int>(n), MPI_BYTE, from, MPI_COMM_WORLD, &request);
    impl_->wait(request);
    at += n;
  }
  (from == impl_->rank ? impl_->traffic.sent : impl_->traffic.received) += length;
}

std::vector<Bytes> Ranks::gather(const Bytes& bytes) {
  const std::uint64_t length = bytes.size();
  std::vector<std::uint64_t> lengths(first() ? static_cast<std::size_t>(impl_->size) : 0);
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Igather(&length, 1, MPI_UINT64_T, lengths.data(), 1, MPI_UINT64_T, 0, MPI_COMM_WORLD, &request);
  impl_->wait(request);
  std::vector<MPI_Request> requests;
  std::vector<Bytes> all(lengths.size());
  if (!first()) {
    impl_->start_send(bytes, 0, requests);
  } else {
    all[0] = bytes;
    for (std::size_t r = 1; r < all.size(); ++r) {
      all[r].resize(lengths[r]);
      impl_->start_receive(all[r], static_cast<int>(r), requests);
    }
  }
  impl_->wait(requests);
  return all;
}

namespace {

template <class T>
MPI_Request reduce(std::span<T> values, MPI_Datatype type, MPI_Op op) {
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Iallreduce(MPI_IN_PLACE, values.data(), static_cast<int>(values.size()), type, op, MPI_COMM_WORLD, &request);
  return request;
}

}  // namespace

void Ranks::sum(std::span<std::uint64_t> values) {
  impl_->wait(reduce(values, MPI_UINT64_T, MPI_SUM));
}
void Ranks::least(std::span<std::int64_t> values) {
  impl_->wait(reduce(values, MPI_INT64_T, MPI_MIN));
}
void Ranks::most(std::span<std::int64_t> values) {
  impl_->wait(reduce(values, MPI_INT64_T, MPI_MAX));
}

std::uint64_t Ranks::sum_before(std::uint64_t value) {
  std::uint64_t before = 0;
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Iexscan(&value, &before, 1, MPI_UINT64_T, MPI_SUM, MPI_COMM_WORLD, &request);
  impl_->wait(request);
  return first() ? 0 : before;
}

void Ranks::exchange(const std::vector<Bytes>& to, std::vector<Bytes>& from) {
  const auto size = static_cast<std::size_t>(impl_->size), own = static_cast<std::size_t>(impl_->rank);
  std::vector<std::uint64_t> out(size), in(size);
  for (std::size_t r = 0; r < size; ++r) out[r] = r == own ? 0 : to[r].size();
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Ialltoall(out.data(), 1, MPI_UINT64_T, in.data(), 1, MPI_UINT64_T, MPI_COMM_WORLD, &request);
  impl_->wait(request);
  from.resize(size);
  std::vector<MPI_Request> requests;
  for (std::size_t r = 0; r < size; ++r) {
    from[r].resize(in[r]);
    impl_->start_receive(from[r], static_cast<int>(r), requests);
  }
  for (std::size_t step = 1; step < size; ++step) {  // each rank begins with another one
    const std::size_t r = (own + step) % size;
    impl_->start_send(to[r], static_cast<int>(r), requests);
  }
  impl_->wait(requests);
}

struct SharedFile::Impl {
  Ranks& ranks;
  std::string name;
  MPI_File file = MPI_FILE_NULL;

  void check(int code) const {
    if (code == MPI_SUCCESS) return;
    int kind = MPI_ERR_OTHER;
    MPI_Error_class(code, &kind);
    if (kind == MPI_ERR_NO_SPACE) report_write_error(name, ENOSPC);
    if (kind == MPI_ERR_QUOTA) report_write_error(name, EDQUOT);
    throw Error(ExitCode::budget, fmt::format("{}: cannot be written: {}", name, mpi_message(code)));
  }
};

SharedFile::SharedFile(Ranks& ranks, const std::string& path, std::string name)
    : impl_(new Impl{ranks, std::move(name)}) {
  ranks.together([&] {
    if (::access(path.c_str(), W_OK) != 0) {
      throw Error(ExitCode::budget,
                  fmt::format("{}: rank {} does not see the folder that rank 0 writes to ({}); all ranks must share it",
                              impl_->name, ranks.rank(), system_message(errno)));
    }
  });
  const int code = MPI_File_open(MPI_COMM_WORLD, path.c_str(), MPI_MODE_WRONLY, MPI_INFO_NULL, &impl_->file);
  ranks.together([&] { impl_->check(code); });
}

SharedFile::~SharedFile() {
  if (impl_->file != MPI_FILE_NULL) MPI_File_close(&impl_->file);
}

void SharedFile::write(std::uint64_t offset, std::span<const std::byte> bytes) {
  const std::byte* at = bytes.data();
  for (const std::size_t n : message_lengths(bytes.size(), kLongestMessage)) {
    MPI_Status status;
    impl_->check(
        MPI_File_write_at(impl_->file, static_cast<MPI_Offset>(offset), at, static_cast<int>(n), MPI_BYTE, &status));
    int written = 0;
    MPI_Get_count(&status, MPI_BYTE, &written);
    if (static_cast<std::size_t>(written) != n) report_write_error(impl_->name, ENOSPC);
    offset += n;
    at += n;
  }
}

void SharedFile::close() {
  const int code = MPI_File_close(&impl_->file);
  impl_->ranks.together([&] { impl_->check(code); });
}

}  // namespace lamina::ranks
#endif
