#include "stages/load/order_zip.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "stages/load/load.h"
#include "stages/load/source.h"
#include "stages/load/text.h"
#include "stages/load/threemf/archive.h"
#include "stages/support/io/file.h"

namespace lamina::load {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxUnpacked = std::uint64_t{8} << 30;

bool is_table_name(const std::string& name) {
  std::string ending = fs::path(name).extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return static_cast<char>(c | 0x20); });
  return ending == ".csv";
}

bool stays_inside(const std::string& name) {
  if (name.find('\\') != std::string::npos || name.find(':') != std::string::npos || fs::path(name).is_absolute()) return false;
  return std::ranges::none_of(fs::path(name), [](const fs::path& each) { return each == ".."; });
}

}  // namespace

Result<std::vector<std::string>> unpack_order(const std::string& path, const std::string& folder) {
  const auto source = Source::open(path);
  if (!source) return source.error();
  LoadOptions options;
  options.expanded_limit = kMaxUnpacked;
  auto archive = Archive::open(*source, options);
  if (!archive) return archive.error();
  std::vector<std::string> unpacked;
  for (const auto& [key, name] : archive->names()) {
    if (!is_part_name(name) && !is_table_name(name)) continue;
    // What macOS adds: data of the Finder under the names of files.
    if (name.starts_with("__MACOSX/") || fs::path(name).filename().string().starts_with("._")) continue;
    if (!stays_inside(name)) return source->error(fmt::format("holds {}, which leads out of its folder", load::quoted(name)));
    const fs::path to = fs::path(folder) / name;
    std::error_code error;
    fs::create_directories(to.parent_path(), error);
    auto file = File::open(to.string(), {.durable = Durable::kNo});
    if (!file) return file.error();
    if (Status status = archive->read(key, [&](std::string_view bytes) { return file->append(bytes); }); !status)
      return status.error();
    if (const auto written = file->finish(); !written) return written.error();
    unpacked.push_back(to.string());
  }
  if (unpacked.empty()) return source->error("holds no STL, OBJ, 3MF or CSV file");
  return unpacked;
}

}  // namespace lamina::load
