// Many small arrays on their way to a device in one piece. What is the same travels once: problems
// of a batch share a model, and many of them a grid and targets.
//
// A parcel is filled twice with the same arrays in the same order: what points from one of them to
// another is known only when the parcel has been measured and memory is found for it. What travels
// once is decided the first time. The second time the bytes might say otherwise, because those
// between the members of a structure are whatever lay there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace trajopt {

class Parcel {
 public:
  // Adds `count` values; returns where they will be. nullptr stays nullptr.
  template <class T>
  T* add(const T* from, std::size_t count) {
    if (from == nullptr) return nullptr;
    const std::size_t bytes = count * sizeof(T);
    if (!addressed_) places_.push_back(place(from, bytes));
    const std::size_t at = places_[addressed_ ? next_++ : places_.size() - 1];
    if (bytes > 0) std::memcpy(bytes_.data() + at, from, bytes);
    // NOLINTNEXTLINE(performance-no-int-to-ptr): memory of a device, or of none yet
    return reinterpret_cast<T*>(base_ + at);
  }

  // Where in device memory it will lie, before it is filled for the second time.
  void address(const void* base) {
    base_ = reinterpret_cast<std::uintptr_t>(base);
    addressed_ = true;
    next_ = 0;
  }

  const std::byte* data() const { return bytes_.data(); }
  std::size_t size() const { return bytes_.size(); }

 private:
  static constexpr std::size_t kAlign = 64;

  std::size_t place(const void* from, std::size_t bytes) {
    const std::size_t hash = std::hash<std::string_view>()({static_cast<const char*>(from), bytes});
    const auto [first, last] = known_.equal_range(hash);
    for (auto at = first; at != last; ++at) {
      const auto [begin, length] = at->second;
      if (length != bytes) continue;
      if (bytes == 0 || std::memcmp(bytes_.data() + begin, from, bytes) == 0) return begin;
    }
    const std::size_t begin = bytes_.size();
    bytes_.resize(begin + (bytes + kAlign - 1) / kAlign * kAlign);
    known_.emplace(hash, Range{begin, bytes});
    return begin;
  }

  struct Range {
    std::size_t begin, length;
  };

  std::uintptr_t base_ = kAlign;  // until there is an address: nothing is at nullptr
  bool addressed_ = false;
  std::vector<std::byte> bytes_;
  std::unordered_multimap<std::size_t, Range> known_;
  std::vector<std::size_t> places_;  // of what was added, in this order
  std::size_t next_ = 0;
};

}  // namespace trajopt
