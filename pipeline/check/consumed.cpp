#include "pipeline/check/consumed.h"

#include <linux/serial.h>
#include <linux/sockios.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <filesystem>

#include "pipeline/job/errors.h"
#include "pipeline/manifest/layer_files.h"
#include "pipeline/output/print_program.h"
#include "stages/support/io/sync.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr int kPatienceMs = 50;  // between two questions of what a slow reader has taken

std::string consumed_path(const std::string& directory) { return (fs::path(directory) / "consumed.jsonl").string(); }

/// The manifest and when it was written, in hexadecimal; "" without one.
std::string id_of_plan(const std::string& directory) {
  const std::string path = (fs::path(directory) / "manifest.json").string();
  struct stat status {};
  const auto digest = digest_file(path);
  if (!digest || ::stat(path.c_str(), &status) != 0) return {};
  return hex(hash_text(fmt::format("{} {} {}", hex(digest->hash), status.st_mtim.tv_sec, status.st_mtim.tv_nsec)));
}

/// The request of ioctl() for bytes that are not taken; 0 where there is none. TIOCOUTQ of a pseudo-terminal is always 0;
/// unlike a serial line it has no TIOCGSERIAL.
unsigned long request_of(int file) {
  struct stat status {};
  if (::fstat(file, &status) != 0) return 0;
  int bytes = 0, type = 0;
  socklen_t size = sizeof type;
  serial_struct serial{};
  unsigned long request = 0;
  if (S_ISFIFO(status.st_mode)) request = FIONREAD;
  if (S_ISSOCK(status.st_mode) && ::getsockopt(file, SOL_SOCKET, SO_TYPE, &type, &size) == 0 && type == SOCK_STREAM)
    request = SIOCOUTQ;
  if (S_ISCHR(status.st_mode) && ::ioctl(file, TIOCGSERIAL, &serial) == 0) request = TIOCOUTQ;
  return request != 0 && ::ioctl(file, request, &bytes) == 0 ? request : 0;
}

}  // namespace

Result<Delivered> read_delivered(const std::string& directory) {
  Delivered delivered;
  std::error_code error;
  if (!fs::exists(consumed_path(directory), error)) return delivered;
  const std::string job = id_of_plan(directory);
  const Status read = read_journal(consumed_path(directory), [&](const std::string& line, std::uint64_t) {
    try {
      if (!json_nests_within(line)) return;
      const Json json = parse_json(line);
      const Delivered known{0, json.at("delivered").get<std::uint32_t>(), true, json.at("end").get<bool>()};
      delivered = !job.empty() && json.at("job").text() == job ? known : Delivered{.earlier = true};
    } catch (const JsonError&) {
      return;  // an incomplete line
    }
  });
  return read ? Result<Delivered>(delivered) : read.error();
}

std::string delivered_text(const Delivered& delivered, std::uint32_t layers) {
  const std::string which = delivered.layers >= layers ? fmt::format("all {} layers", layers)
                                                       : fmt::format("layers 0 to {} of {}", delivered.layers - 1, layers);
  return which + " were delivered and deleted by lamina stream --consume";
}

Result<Consumption> Consumption::begin(const std::string& directory, const Manifest& manifest, File& output) {
  const unsigned long request = output.streams() ? request_of(output.descriptor()) : 0;
  if (request == 0)
    return usage("--consume: the output must be a pipe, a stream socket or a serial line, which report what was received");
  if (Status status = check_stays_inside(directory); !status) return status.error();
  const auto delivered = read_delivered(directory);
  if (!delivered) return delivered.error();
  const std::string path = consumed_path(directory);
  if (delivered->earlier) return usage("{}: is of an earlier plan of this job; remove it to begin with the first layer", path);
  auto journal = Journal::open(path, "another lamina stream --consume is running here; wait for it");
  if (!journal) return journal.error();
  if (const int reason = sync_folder(directory); reason != 0) return write_failure(directory, reason);
  Consumption consumption(directory, manifest, output, std::move(*journal));
  consumption.job_ = id_of_plan(directory);
  consumption.request_ = request;
  consumption.delivered_ = *delivered;
  Status status = consumption.journal_.read([](const std::string&, std::uint64_t) {});  // finds a torn last line
  if (status) status = consumption.remove();
  return status ? Result<Consumption>(std::move(consumption)) : status.error();
}

Status Consumption::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    if (Status status = settle(); !status) return status;
    pollfd ready{output_.descriptor(), POLLOUT, 0};
    if (::poll(&ready, 1, kPatienceMs) <= 0) continue;
    // So much does not wait in a pipe that is ready.
    const auto piece = bytes.first(std::min<std::size_t>(bytes.size(), PIPE_BUF));
    Status status = output_.append(piece);
    if (status) status = output_.flush();
    if (!status) return status;
    bytes = bytes.subspan(piece.size());
  }
  return {};
}

Status Consumption::wrote(std::uint32_t layers, bool end) {
  written_.push_back({output_.size(), layers, true, end});
  return settle();
}

Status Consumption::settle() {
  if (written_.empty()) return {};
  int left = 0;
  if (::ioctl(output_.descriptor(), request_, &left) != 0) return write_failure(directory_, errno);
  const std::uint64_t taken = output_.size() - std::min(output_.size(), static_cast<std::uint64_t>(left));
  if (written_.front().bytes > taken) return {};
  for (; !written_.empty() && written_.front().bytes <= taken; written_.pop_front()) delivered_ = written_.front();
  const Json line = {{"job", job_}, {"delivered", delivered_.layers}, {"end", delivered_.end}};
  Status status = journal_.append(json_text(line) + "\n");
  if (status) status = journal_.sync();
  return status ? remove() : status;
}

Status Consumption::finish() {
  while (true) {
    pollfd gone{output_.descriptor(), 0, 0};
    const bool ended = ::poll(&gone, 1, 0) > 0;
    if (Status status = settle(); !status || written_.empty()) return status;
    if (ended)
      return failure(Fault::kOutput, "{}: the reader ended after layer {} and part of the next", directory_, delivered_.layers);
    ::poll(nullptr, 0, 1);
  }
}

Status Consumption::remove() {
  const auto end = std::min(delivered_.layers, static_cast<std::uint32_t>(manifest_.layers.size()));
  for (; removed_ < end; ++removed_) {
    const LayerRecord& record = manifest_.layers[removed_];
    std::vector<LayerImageFile> files = layer_images(manifest_.head, record);
    files.push_back({program_file_name(record.layer.index, manifest_.head.program_extension), {}});
    for (const LayerImageFile& file : files) {
      std::error_code error;
      if (!file.name.empty() && !fs::remove(fs::path(directory_) / file.name, error) && error)
        return failure(Fault::kOutput, "{}/{}: cannot be deleted: {}", directory_, file.name, error.message());
    }
  }
  return {};
}

}  // namespace lamina::pipeline
