// stages/view/report/held_layers.h: selects the layers that fit into a page.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"

namespace lamina::view::report {

/// Codes of layers (run_code.h), added in order and limited to the page's size: beyond the limit, every second one is
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
