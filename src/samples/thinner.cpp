#include "samples/thinner.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/hashing.h"

namespace lamina {
namespace {

constexpr std::size_t kFewest = 1 << 10;

std::int64_t cell_along(std::int64_t a, std::int64_t b) {
  return a / b - static_cast<std::int64_t>(a % b != 0 && a < 0);
}

}  // namespace

Thinner::Thinner(double distance)
    : distance_(std::min(distance, 0x1p31)),
      squared_(distance_ * distance_),
      cell_(std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(2 * distance_)))),
      heads_(kFewest, kNone) {}

std::size_t Thinner::place(std::int64_t x, std::int64_t y, std::int64_t z) const {
  return cell_hash(x, y, z) & (heads_.size() - 1);
}

std::size_t Thinner::home(const Kept& k) const {
  return place(cell_along(k.x, cell_), cell_along(k.y, cell_), cell_along(k.z, cell_));
}

bool Thinner::is_near_kept(const Kept& s) const {
  const auto within = static_cast<std::int64_t>(distance_);
  const auto first = [&](std::int64_t v) { return cell_along(v - within, cell_); };
  const auto last = [&](std::int64_t v) { return cell_along(v + within, cell_); };
  for (std::int64_t z = first(s.z); z <= last(s.z); ++z) {
    for (std::int64_t y = first(s.y); y <= last(s.y); ++y) {
      for (std::int64_t x = first(s.x); x <= last(s.x); ++x) {
        for (std::uint32_t i = heads_[place(x, y, z)]; i != kNone; i = kept_[i].next) {
          const Kept& k = kept_[i];
          const double dx = static_cast<double>(s.x) - k.x;
          const double dy = static_cast<double>(s.y) - k.y;
          const double dz = static_cast<double>(s.z) - k.z;
          const float facing = s.nx * k.nx + s.ny * k.ny + s.nz * k.nz;
          if (dx * dx + dy * dy + dz * dz <= squared_ && facing >= 0) return true;
        }
      }
    }
  }
  return false;
}

void Thinner::rehash(std::size_t least) {
  heads_.assign(std::max(kFewest, std::bit_ceil(2 * least)), kNone);
  for (std::uint32_t i = 0; i < kept_.size(); ++i) {
    std::uint32_t& head = heads_[home(kept_[i])];
    kept_[i].next = head;
    head = i;
  }
}

void Thinner::forget_below(std::int64_t z) {
  kept_.erase(std::remove_if(kept_.begin(), kept_.end(), [&](const Kept& k) { return k.z < z; }), kept_.end());
}

std::uint64_t Thinner::thin(const LocalSamples& samples, std::vector<bool>& keep) {
  if (samples.size() == 0) return 0;
  const std::int64_t low = *std::min_element(samples.z.begin(), samples.z.end());
  forget_below(low - static_cast<std::int64_t>(distance_) - 1);
  rehash(kept_.size() + samples.size());
  std::uint64_t dropped = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!keep[i]) continue;
    Kept s{samples.x[i], samples.y[i], samples.z[i], samples.nx[i], samples.ny[i], samples.nz[i], kNone};
    if (is_near_kept(s)) {
      keep[i] = false;
      ++dropped;
      continue;
    }
    std::uint32_t& head = heads_[home(s)];
    s.next = head;
    head = static_cast<std::uint32_t>(kept_.size());
    kept_.push_back(s);
  }
  return dropped;
}

}  // namespace lamina
