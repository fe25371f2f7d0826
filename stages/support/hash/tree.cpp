#include "stages/support/hash/tree.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

namespace lamina {

TreeDigest digest_of(std::vector<std::pair<std::string, FileDigest>> files) {
  std::ranges::sort(
      files, [](const auto& a, const auto& b) { return std::filesystem::path(a.first) < std::filesystem::path(b.first); });
  TreeDigest digest;
  std::string text;
  for (const auto& [name, file] : files) {
    text += fmt::format("{} {} {}\n", name, file.bytes, hex(file.hash));
    digest.bytes += file.bytes;
  }
  digest.files = files.size();
  digest.hash = hash_text(text);
  return digest;
}

}  // namespace lamina
