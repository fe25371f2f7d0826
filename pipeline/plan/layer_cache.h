// pipeline/plan/layer_cache.h: what several layers need of their neighbours, made once for all of them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// The values of the last layers, by index. Thread-safe; values are const, and live as long as someone has them.
template <class Value>
class LayerCache {
 public:
  using Shared = std::shared_ptr<const Value>;

  /// The value of a layer: kept, or made by `make()`, which returns Result<Value>. Another thread may make it at the same time:
  /// waiting would idle, and both make the same. errors  of make()
  template <class Make>
  Result<Shared> get(std::uint32_t index, Make make) {
    {
      const std::lock_guard lock(mutex_);
      if (const auto found = kept_.find(index); found != kept_.end()) return found->second;
    }
    auto made = make();
    if (!made) return made.error();
    auto shared = std::make_shared<const Value>(std::move(*made));
    const std::lock_guard lock(mutex_);
    kept_.try_emplace(index, shared);
    // Layers are made upwards: the lowest one is needed least.
    while (kept_.size() > capacity_) kept_.erase(kept_.begin());
    return shared;
  }

  /// At least so many are kept from now on.
  void reserve(std::uint32_t count) {
    const std::lock_guard lock(mutex_);
    capacity_ = std::max<std::size_t>(capacity_, count);
  }
  std::uint64_t bytes() const {
    const std::lock_guard lock(mutex_);
    std::uint64_t sum = 0;
    for (const auto& [index, value] : kept_) sum += value->bytes();
    return sum;
  }

 private:
  mutable std::mutex mutex_;
  std::size_t capacity_ = 1;
  std::map<std::uint32_t, Shared> kept_;
};

}  // namespace lamina::pipeline
