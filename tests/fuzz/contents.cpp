// Files of one Zstandard frame, as print programs are stored.
#include "stages/support/io/compressed.h"

#include <zstd.h>

#include "tests/fuzz/laws.h"

namespace lamina::fuzz {
namespace {

constexpr std::uint64_t kMaxContent = 1 << 20;

bool read_content_of(std::string_view bytes) {
  static MemoryFile file("000042.planes.zst");
  const std::string& path = file.hold(bytes);
  std::uint64_t passed = 0;
  const Status status = expand_file(path, kMaxContent, [&](std::span<const std::byte> piece) {
    law(piece.size() <= 256 << 10, "a piece is longer than promised");
    passed += piece.size();
    law(passed <= kMaxContent, "more than the limit is passed on");
    return Status();
  });
  if (!status) return check_error(status.error()), false;
  const auto content = read_content(path, kMaxContent);
  law(content.ok() && content->size() == passed, "a frame expands to another size");
  const auto digest = digest_content(path, passed);
  law(digest.ok() && digest->bytes == passed && digest->hash == hash_text(*content), "its hash is that of another content");
  law(fault_of_stored(path, passed).empty(), "a whole frame is not whole");
  return true;
}

std::vector<std::string> content_seeds() {
  std::vector<std::string> seeds;
  for (const std::size_t size : {0u, 10u, 3000u}) {
    const std::string content(size, 'x');
    std::string frame(ZSTD_compressBound(size), '\0');
    frame.resize(ZSTD_compress(frame.data(), frame.size(), content.data(), size, 1));
    seeds.push_back(frame);
  }
  return seeds;
}

const Registered kContents({"contents", read_content_of, content_seeds, "stages/support/io/compressed", ""});

}  // namespace
}  // namespace lamina::fuzz
