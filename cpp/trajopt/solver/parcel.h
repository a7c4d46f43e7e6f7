// Many small arrays on their way to a device in one piece. What is the same travels once: problems
// of a batch share a model, and many of them a grid and targets.
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
  // `base`: where in device memory it will lie. With nullptr it can only be measured.
  explicit Parcel(const void* base) : base_(reinterpret_cast<std::uintptr_t>(base)) {}

  // Adds `count` values; returns where they will be. nullptr stays nullptr.
  template <class T>
  T* add(const T* from, std::size_t count) {
    if (from == nullptr) return nullptr;
    return reinterpret_cast<T*>(base_ + place(from, count * sizeof(T)));
  }

  const std::byte* data() const { return bytes_.data(); }
  std::size_t size() const { return bytes_.size(); }

 private:
  static constexpr std::size_t kAlign = 64;

  std::size_t place(const void* from, std::size_t bytes) {
    const std::string_view text(static_cast<const char*>(from), bytes);
    const auto [first, last] = known_.equal_range(std::hash<std::string_view>()(text));
    for (auto at = first; at != last; ++at) {
      const auto [begin, length] = at->second;
      if (length == bytes && std::memcmp(bytes_.data() + begin, from, bytes) == 0) return begin;
    }
    const std::size_t begin = bytes_.size();
    bytes_.resize(begin + (bytes + kAlign - 1) / kAlign * kAlign);
    if (bytes > 0) std::memcpy(bytes_.data() + begin, from, bytes);
    known_.emplace(std::hash<std::string_view>()(text), Range{begin, bytes});
    return begin;
  }

  struct Range {
    std::size_t begin, length;
  };

  std::uintptr_t base_;
  std::vector<std::byte> bytes_;
  std::unordered_multimap<std::size_t, Range> known_;
};

}  // namespace trajopt
