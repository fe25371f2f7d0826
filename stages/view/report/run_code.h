// stages/view/report/run_code.h: runs as few bytes, for a page that unpacks them where they are shown, and the layers that fit.
//
// Row by row, all numbers in base 128, low digit first, the high bit set on all bytes but the last:
//   0 n          the next n rows are like the row before (before the first row: empty)
//   1 p ...      as many runs as in the row before, each with its begin moved by b and its end by e, folded: 0 -1 1 -2 2 ...
//                are 0 1 2 3 4 ...; p is one byte, 15 b + e, where both are below 15; 223 + n of n runs that stay, 2 to 31;
//                else 255, and b and e follow
//   2 + m g ...  m changes, each the one before it in the row plus g (the first: g)
// and all of that in one zlib stream. Most rows of a part are like the row before, or near to it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/geometry/bits.h"

namespace lamina::view::report {

/// The code of an image, deflated. cost  one pass over the changes, and deflate
Buffer<std::byte> pack_runs(RowRuns image);

/// Any bytes as one zlib stream.
Buffer<std::byte> deflate_bytes(std::span<const std::byte> bytes);

/// Codes of layers (pack_runs), added in order and limited to the page's size: beyond the limit, every second one is
/// dropped.
class HeldLayers {
 public:
  /// limit  bytes of the page
  explicit HeldLayers(std::uint64_t limit) : limit_(limit) {}

  bool wants(std::uint32_t location) const { return location % stride_ == 0; }
  /// cost  O(1), and O(layers held) each time their number is halved
  void add(std::uint32_t location, Buffer<std::byte> code) {
    if (!wants(location)) return;
    bytes_ += cost(code);
    layers_.push_back({location, std::move(code)});
    while (bytes_ > limit_ && layers_.size() > 1) {
      stride_ *= 2;
      std::erase_if(layers_, [&](const auto& layer) { return layer.first % stride_ != 0; });
      bytes_ = 0;
      for (const auto& layer : layers_) bytes_ += cost(layer.second);
    }
  }
  /// Every stride-th layer is held.
  std::uint32_t stride() const { return stride_; }
  /// Places and codes.
  std::vector<std::pair<std::uint32_t, Buffer<std::byte>>>& layers() { return layers_; }

 private:
  static std::uint64_t cost(const Buffer<std::byte>& code) { return code.size() / 3 * 4 + 60; }
  std::uint64_t limit_, bytes_ = 0;
  std::uint32_t stride_ = 1;
  std::vector<std::pair<std::uint32_t, Buffer<std::byte>>> layers_;
};

}  // namespace lamina::view::report
