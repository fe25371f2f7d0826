// stages/load/zip_check.cpp: what a zip file would become, before a library is asked to hold it.
#include <fmt/core.h>
#include <zip.h>

#include <memory>

#include "stages/load/component_scan.h"
#include "stages/load/reader.h"

namespace lamina::load {
namespace {

/// Discards a handle that was only read from.
struct Discard {
  void operator()(zip_t* archive) const { zip_discard(archive); }
  void operator()(zip_file_t* file) const { zip_fclose(file); }
};

}  // namespace

Status check_package(const Source& source, const LoadOptions& options) {
  int code = 0;
  const std::unique_ptr<zip_t, Discard> archive(zip_open(source.path().c_str(), ZIP_RDONLY, &code));
  if (archive == nullptr) {
    zip_error_t why;
    zip_error_init_with_code(&why, code);
    const std::string text = zip_error_strerror(&why);
    zip_error_fini(&why);
    return source.error(fmt::format("is not a whole zip file ({}); copy or export it again", text));
  }
  Buffer<char> block(std::size_t{1} << 18);
  std::uint64_t total = 0;
  ComponentScan scan;
  const zip_int64_t entries = zip_get_num_entries(archive.get(), 0);
  for (zip_int64_t i = 0; i < entries; ++i) {
    zip_stat_t entry;
    zip_stat_init(&entry);
    if (zip_stat_index(archive.get(), static_cast<zip_uint64_t>(i), 0, &entry) != 0 || (entry.valid & ZIP_STAT_NAME) == 0)
      return source.error(fmt::format("zip entry {} is damaged; copy or export the file again", i + 1));
    if ((entry.valid & ZIP_STAT_ENCRYPTION_METHOD) != 0 && entry.encryption_method != ZIP_EM_NONE)
      return source.error("is encrypted; save it without a password");
    const std::unique_ptr<zip_file_t, Discard> file(zip_fopen_index(archive.get(), static_cast<zip_uint64_t>(i), 0));
    if (file == nullptr)
      return source.error(
          fmt::format("zip entry {} cannot be opened ({}); copy or export the file again", i + 1, zip_strerror(archive.get())));
    std::uint64_t expanded = 0;
    scan.begin_file(entry.name);
    while (true) {
      const zip_int64_t got = zip_fread(file.get(), block.data(), block.size());
      if (got < 0)
        return source.error(
            fmt::format("zip entry {} is damaged ({}); copy or export the file again", i + 1, zip_file_strerror(file.get())));
      if (got == 0) break;
      expanded += static_cast<std::uint64_t>(got);
      total += static_cast<std::uint64_t>(got);
      if (total > options.expanded_limit)
        return source.error(fmt::format("expands to more than the limit of {} bytes", options.expanded_limit));
      if (expansion_is_absurd((entry.valid & ZIP_STAT_COMP_SIZE) != 0 ? entry.comp_size : source.size(), expanded) ||
          expansion_is_absurd(source.size(), total))
        return source.error("expands more than 200-fold, as no part does; unzip it to see what it is");
      scan.feed(block.data(), static_cast<std::size_t>(got));
    }
  }
  return scan.check(source, options.triangle_limit);
}

}  // namespace lamina::load
