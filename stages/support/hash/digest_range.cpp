#include "stages/support/hash/digest_range.h"

#include <xxhash.h>

#include <algorithm>
#include <memory>
#include <vector>

namespace lamina {

std::optional<Hash128> digest_range(const FileReader& file, std::uint64_t offset, std::uint64_t bytes) {
  const std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> state(XXH3_createState(), XXH3_freeState);
  XXH3_128bits_reset(state.get());
  std::vector<char> piece(static_cast<std::size_t>(std::min<std::uint64_t>(bytes, 256 << 10)));
  while (bytes > 0) {
    const std::span<char> part = std::span(piece).first(static_cast<std::size_t>(std::min<std::uint64_t>(bytes, piece.size())));
    if (!file.read_at(offset, part)) return std::nullopt;
    XXH3_128bits_update(state.get(), part.data(), part.size());
    offset += part.size();
    bytes -= part.size();
  }
  const XXH128_hash_t hash = XXH3_128bits_digest(state.get());
  return Hash128{hash.high64, hash.low64};
}

}  // namespace lamina
