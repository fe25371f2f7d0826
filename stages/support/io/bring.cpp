#include "stages/support/io/bring.h"

#include <fmt/format.h>

#include <filesystem>

#include "stages/support/io/leftovers.h"
#include "stages/support/io/temporary.h"

namespace lamina::write {

Status check_plain(const std::string& file, std::optional<std::uint64_t> bytes) {
  namespace fs = std::filesystem;
  const auto refuse = [&](const std::string& what) {
    return Error{Fault::kVerification, fmt::format("{}: {}; run its shard again with --resume", file, what)};
  };
  std::error_code error;
  const fs::file_status status = fs::symlink_status(file, error);
  if (!fs::is_regular_file(status)) return refuse(fs::exists(status) ? "is a link or a device, not a file" : "is missing");
  if (!bytes) return {};
  const std::uintmax_t size = fs::file_size(file, error);
  if (error) return refuse("is missing");
  return size == *bytes ? Status() : Status(refuse(fmt::format("{} bytes, the manifest says {}", size, *bytes)));
}

Result<bool> bring_file(const std::string& from, const std::string& to) {
  namespace fs = std::filesystem;
  const std::string fresh = temporary_name(to);
  const int watched = watch(fresh.c_str());
  std::error_code error;
  fs::create_hard_link(from, fresh, error);
  const bool linked = !error;
  if (!linked) fs::copy_file(from, fresh, error);
  if (!error) fs::rename(fresh, to, error);
  remove_or_note(fresh);  // stays if `to` was a name of the same file already, and after an error
  forget(watched);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", to, error.message())};
  return linked;
}

}  // namespace lamina::write
