#include "stages/checks/united.h"

#include <algorithm>
#include <utility>

namespace lamina::sanity {

United::United(std::span<const Mesh> meshes, std::span<const Instance> instances, std::span<const Solid> solids, Volume volume,
               Again again)
    : meshes_(meshes), volume_(std::move(volume)), again_(std::move(again)) {
  for (std::size_t i = 0; i < instances.size(); ++i) {
    if (members_.size() <= solids[i].group) members_.resize(std::size_t{solids[i].group} + 1);
    members_[solids[i].group].push_back(instances[i]);
  }
}

United::Key United::key_of(std::span<const Instance> members) {
  Key key;
  for (const Instance& one : members) key.push_back({one.mesh, one.offset.x, one.offset.y, one.offset.z});
  std::ranges::sort(key);
  for (auto at = key.rbegin(); at != key.rend(); ++at)
    for (std::size_t axis = 1; axis < 4; ++axis) (*at)[axis] -= key.front()[axis];
  return key;
}

Result<double> United::compute(std::span<const Instance> members) {
  if (!again_) return volume_(meshes_, members);
  if (!reread_) reread_.emplace(again_());
  if (!*reread_) return reread_->error();
  const std::vector<Mesh>& now = **reread_;
  const auto changed = [&](const Instance& one) {
    return one.mesh >= now.size() || now[one.mesh].fingerprint != meshes_[one.mesh].fingerprint;
  };
  if (now.size() != meshes_.size() || std::ranges::any_of(members, changed)) {
    return Error{Fault::kInput, "a part has changed since it was planned"};
  }
  return volume_(now, members);
}

Result<double> United::mm3(std::uint32_t group) {
  if (group >= members_.size()) return 0.0;
  const std::vector<Instance>& members = members_[group];
  Key key = key_of(members);
  const auto found = known_.find(key);
  return found != known_.end() ? found->second : known_.emplace(std::move(key), compute(members)).first->second;
}

}  // namespace lamina::sanity
