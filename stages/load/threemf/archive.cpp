#include "stages/load/threemf/archive.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/load/messages.h"
#include "stages/load/text.h"
#include "stages/support/late/zip.h"
#include "stages/support/text/part_name.h"

namespace lamina::load {
namespace {

struct CloseEntry {
  void operator()(zip_file_t* file) const { zip_fclose(file); }
};

struct SourceOfZip {
  const Source* source;
  std::uint64_t* position;
};

zip_int64_t read_source(const SourceOfZip& from, void* data, zip_uint64_t count) {
  const std::uint64_t maximum = std::min<std::uint64_t>(count, from.source->size() - *from.position);
  if (!from.source->read(*from.position, static_cast<char*>(data), static_cast<std::size_t>(maximum))) return -1;
  *from.position += maximum;
  return static_cast<zip_int64_t>(maximum);
}

/// libzip reads from a Source, on disk or in memory, by these commands.
zip_int64_t serve_zip(void* user, void* data, zip_uint64_t count, zip_source_cmd_t command) {
  const auto& from = *static_cast<SourceOfZip*>(user);
  switch (command) {
    case ZIP_SOURCE_OPEN: *from.position = 0; return 0;
    case ZIP_SOURCE_CLOSE: return 0;
    case ZIP_SOURCE_READ: return read_source(from, data, count);
    case ZIP_SOURCE_TELL: return static_cast<zip_int64_t>(*from.position);
    case ZIP_SOURCE_SEEK: {
      zip_error_t error;
      zip_error_init(&error);
      const zip_int64_t position = zip_source_seek_compute_offset(*from.position, from.source->size(), data, count, &error);
      zip_error_fini(&error);
      if (position >= 0) *from.position = static_cast<std::uint64_t>(position);
      return position < 0 ? -1 : 0;
    }
    case ZIP_SOURCE_STAT: {
      auto* const stat = static_cast<zip_stat_t*>(data);
      zip_stat_init(stat);
      stat->valid = ZIP_STAT_SIZE;
      stat->size = from.source->size();
      return sizeof(zip_stat_t);
    }
    case ZIP_SOURCE_ERROR: {
      const int codes[2] = {ZIP_ER_READ, 0};
      std::copy(std::begin(codes), std::end(codes), static_cast<int*>(data));
      return sizeof codes;
    }
    case ZIP_SOURCE_FREE: delete static_cast<SourceOfZip*>(user); return 0;
    case ZIP_SOURCE_SUPPORTS:
      return zip_source_make_command_bitmap(ZIP_SOURCE_OPEN, ZIP_SOURCE_READ, ZIP_SOURCE_CLOSE, ZIP_SOURCE_STAT,
                                            ZIP_SOURCE_ERROR, ZIP_SOURCE_FREE, ZIP_SOURCE_SEEK, ZIP_SOURCE_TELL,
                                            ZIP_SOURCE_SUPPORTS, -1);
    default: return -1;
  }
}

}  // namespace

void Archive::Discard::operator()(zip* archive) const { zip_discard(archive); }

Result<Archive> Archive::open(const Source& source, const LoadOptions& options) {
  if (const Status loaded = load_zip(); !loaded) return loaded.error();
  Archive archive(source, options);
  archive.position_ = std::make_unique<std::uint64_t>(0);
  zip_error_t why;
  zip_error_init(&why);
  auto user = std::make_unique<SourceOfZip>(SourceOfZip{&source, archive.position_.get()});
  zip_source_t* const from = zip_source_function_create(serve_zip, user.get(), &why);
  if (from != nullptr) {
    static_cast<void>(user.release());  // freed by ZIP_SOURCE_FREE
    archive.archive_.reset(zip_open_from_source(from, ZIP_RDONLY, &why));
    if (archive.archive_ == nullptr) zip_source_free(from);
  }
  const std::string text = archive.archive_ == nullptr ? zip_error_strerror(&why) : "";
  zip_error_fini(&why);
  if (archive.archive_ == nullptr)
    return source.error(fmt::format("is not a whole zip file ({}); copy or export it again", text));
  if (const Status listed = archive.list(); !listed) return listed.error();
  return archive;
}

Status Archive::check_sizes(std::uint64_t packed, std::uint64_t expanded, std::uint64_t total) const {
  if (total > limit_) return source_->error(fmt::format("expands to more than the limit of {} bytes", limit_));
  if (expansion_is_absurd(packed, expanded) || expansion_is_absurd(source_->size(), total))
    return source_->error("expands more than 200-fold, as no part does; unzip it to see what it is");
  return {};
}

Status Archive::list() {
  std::uint64_t total = 0;
  const zip_int64_t count = zip_get_num_entries(archive_.get(), 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    zip_stat_t entry;
    zip_stat_init(&entry);
    const zip_uint64_t needed = ZIP_STAT_NAME | ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE;
    if (zip_stat_index(archive_.get(), static_cast<zip_uint64_t>(i), 0, &entry) != 0 || (entry.valid & needed) != needed)
      return source_->error(fmt::format("zip entry {} is damaged; copy or export the file again", i + 1));
    if ((entry.valid & ZIP_STAT_ENCRYPTION_METHOD) != 0 && entry.encryption_method != ZIP_EM_NONE)
      return source_->error("is encrypted; save it without a password");
    total += std::min<std::uint64_t>(entry.size, UINT64_MAX - total);
    if (const Status fits = check_sizes(entry.comp_size, entry.size, total); !fits) return fits;
    const std::string_view name = entry.name;
    if (name.ends_with('/') || name.ends_with('\\')) continue;
    if (!entries_.emplace(part_name(name), PackedFile{static_cast<std::uint64_t>(i), entry.comp_size}).second)
      return source_->error(fmt::format("holds two entries of the name {}; export it again", quoted(name)));
  }
  return {};
}

Status Archive::read(const std::string& name, const std::function<Status(std::string_view)>& take) {
  const PackedFile& entry = entries_.at(name);
  const auto damaged = [&](const char* why) {
    return source_->error(fmt::format("zip entry {} is damaged ({}); copy or export the file again", entry.index + 1, why));
  };
  const std::unique_ptr<zip_file_t, CloseEntry> file(zip_fopen_index(archive_.get(), entry.index, 0));
  if (file == nullptr) return damaged(zip_strerror(archive_.get()));
  Buffer<char> block(std::size_t{64} << 10);
  std::uint64_t expanded = 0;
  while (true) {
    const zip_int64_t got = zip_fread(file.get(), block.data(), block.size());
    if (got < 0) return damaged(zip_file_strerror(file.get()));
    if (got == 0) return {};
    expanded += static_cast<std::uint64_t>(got);
    inflated_ += static_cast<std::uint64_t>(got);
    if (const Status fits = check_sizes(entry.packed, expanded, inflated_); !fits) return fits;
    if (const Status taken = take({block.data(), static_cast<std::size_t>(got)}); !taken) return taken;
  }
}

}  // namespace lamina::load
