// stages/dose/share_count.h: what a job of shares of voxels came to, layer by layer, for people and for programs.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace lamina::dose {

class ShareCount {
 public:
  /// full_voxels  that the layer's levels come to
  /// differs, far  of take_half(): voxels half full or more against pixels whose centre is set
  void add(std::uint64_t full_voxels, std::uint64_t differs, std::uint64_t far);

  /// The summary's line. levels  of a voxel; as  what they are written as
  std::string told(std::uint32_t levels, std::string_view as) const;
  nlohmann::ordered_json json(std::uint32_t levels, std::string_view as) const;

 private:
  double differing_share() const;

  std::uint64_t full_voxels_ = 0, differs_ = 0, far_ = 0;
};

}  // namespace lamina::dose
