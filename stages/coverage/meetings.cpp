#include "stages/coverage/meetings.h"

namespace lamina::cover {

Suspects find_suspects(const MeshBlocks& mesh, const SlabIndex&) {
  Suspects suspects;
  suspects.assign(mesh.cluster_count(), 0xFFFF);
  return suspects;
}

}  // namespace lamina::cover
