// The sliding window: each pushed slab moves every stage on by one slab. After push of slab n, slab n - 1 is counted
// and classified, n - 2 decided, n - 3 numbered and finished; of n - 4 only the notes of border triangles are still
// read.
#include <deque>
#include <utility>

#include "clustering/clusterer.h"
#include "clustering/steps.h"

namespace lamina {

using clustering::SlabRecord;
using clustering::Verdict;
using clustering::Window;

struct Clusterer::Impl {
  ClusterSettings settings;
  ClusterCounts counts;
  Window window;
  std::deque<FinalSlab> finished;
  FinalSlab spare;  ///< storage of the slab the caller handed back at its last pop
  std::uint64_t next_number = 0;
  std::int64_t first = 0, last = 0;  ///< pushed slabs
  bool begun = false, ended = false;

  void advance(std::shared_ptr<const IsoSlab> iso);
  void classify(std::int64_t slab);
};

void Clusterer::Impl::classify(std::int64_t slab) {
  switch (settings.mode) {
    case ClusterMode::none:
      return;
    case ClusterMode::free: {
      SlabRecord& here = window.at(slab);
      for (std::size_t c = 0; c < here.corners.size(); ++c) {
        here.verdicts[c] = here.corners[c].ring_triangles > 0 ? Verdict::corner : Verdict::absent;
      }
      return;
    }
    case ClusterMode::preserving:
      return clustering::classify(window, slab);
  }
}

void Clusterer::Impl::advance(std::shared_ptr<const IsoSlab> iso) {
  const std::int64_t slab = iso->slab;
  // Five records are read: the one before them gives the new one its storage.
  if (slab - 5 >= first) std::swap(window.at(slab), window.at(slab - 5));
  // Corners' notes are read in two.
  if (slab - 2 >= first) std::swap(window.at(slab).corners, window.at(slab - 2).corners);
  clustering::lay_out(window.at(slab), std::move(iso));
  if (slab - 1 < first) return;
  clustering::count_triangles(window, slab - 1, settings.mode);
  classify(slab - 1);
  if (slab - 2 < first) return;
  if (settings.mode == ClusterMode::preserving) clustering::decide(window, slab - 2);
  if (slab - 3 < first) return;
  FinalSlab out = std::move(spare);
  clustering::number(window, slab - 3, next_number, out, counts);
  finished.push_back(std::move(out));
  window.at(slab - 3).iso.reset();
}

Clusterer::Clusterer(const ClusterSettings& settings) : impl_(std::make_unique<Impl>()) {
  impl_->settings = settings;
}
Clusterer::~Clusterer() = default;

void Clusterer::push(std::shared_ptr<const IsoSlab> slab) {
  Impl& impl = *impl_;
  if (!slab) throw Error(ExitCode::internal, "clustering: no surface slab given");
  if (impl.ended) clustering::bad_slab(slab->slab, "pushed after the end");
  if (impl.begun && slab->slab != impl.last + 1) {
    clustering::bad_slab(slab->slab, "pushed out of order, slab " + std::to_string(impl.last + 1) + " is next");
  }
  if (!impl.begun) impl.first = slab->slab;
  impl.begun = true;
  impl.last = slab->slab;
  impl.advance(std::move(slab));
}

void Clusterer::finish() {
  Impl& impl = *impl_;
  if (impl.ended) return;
  impl.ended = true;
  if (!impl.begun) return;
  for (std::int64_t beyond = 1; beyond <= 3; ++beyond) {
    auto empty = std::make_shared<IsoSlab>();
    empty->slab = impl.last + beyond;
    impl.advance(std::move(empty));
  }
}

bool Clusterer::pop(FinalSlab& out) {
  if (impl_->finished.empty()) return false;
  std::swap(out, impl_->finished.front());
  impl_->spare = std::move(impl_->finished.front());
  impl_->finished.pop_front();
  return true;
}

const ClusterCounts& Clusterer::counts() const {
  return impl_->counts;
}

}  // namespace lamina
