// Built without MPI: there are no ranks.
#ifndef LAMINA_MPI
#include "lamina/error.h"
#include "ranks/ranks.h"

namespace lamina::ranks {

struct Ranks::Impl {
  Traffic traffic;
};
struct SharedFile::Impl {};

namespace {

[[noreturn]] void no_mpi() {
  throw Error(ExitCode::usage,
              "was started as one of several processes, but built without MPI: start it alone, or build it where "
              "CMake finds MPI (Debian: libopenmpi-dev)");
}

}  // namespace

Ranks::Ranks() {
  no_mpi();
}
Ranks::~Ranks() = default;
int Ranks::rank() const {
  return 0;
}
int Ranks::size() const {
  return 1;
}
const Traffic& Ranks::traffic() const {
  return impl_->traffic;
}
void Ranks::together(const std::function<void()>& work) {
  work();
}
bool Ranks::failed_elsewhere() {
  return false;
}
void Ranks::note_failure() {}
void Ranks::send(int, const Bytes&) {}
Bytes Ranks::receive(int) {
  return {};
}
void Ranks::broadcast(Bytes&, int) {}
std::vector<Bytes> Ranks::gather(const Bytes& bytes) {
  return {bytes};
}
void Ranks::sum(std::span<std::uint64_t>) {}
void Ranks::least(std::span<std::int64_t>) {}
void Ranks::most(std::span<std::int64_t>) {}
std::uint64_t Ranks::sum_before(std::uint64_t) {
  return 0;
}
void Ranks::exchange(const std::vector<Bytes>&, std::vector<Bytes>&) {}
SharedFile::SharedFile(Ranks&, const std::string&, std::string) {
  no_mpi();
}
SharedFile::~SharedFile() = default;
void SharedFile::write(std::uint64_t, std::span<const std::byte>) {}
void SharedFile::close() {}

}  // namespace lamina::ranks
#endif
