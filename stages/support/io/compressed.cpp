#include "stages/support/io/compressed.h"

#include <fmt/format.h>
#include <xxhash.h>
#include <zstd.h>

#include <unistd.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>
#include <vector>

#include "stages/support/io/file_reader.h"

namespace lamina {
namespace {

// On planes of full beds the fastest positive level is within a few percent of the speed and size of the next two, and a window
// of 2 MiB halves what one of 512 KiB leaves.
constexpr int kLevel = 1, kWindowLog = 21, kMaxWindowLog = 23;
constexpr std::size_t kContentPiece = 256 << 10;
constexpr std::size_t kCachedPiece = 64 << 10;  // is hashed and compressed while it is in a core's own cache
// A frame's head with its content's size: magic number, descriptor, window, eight bytes of size.
constexpr std::size_t kDescriptor = 4, kSizeOffset = 6, kSizeBytes = 8, kMaxHead = 18;
constexpr unsigned char kSizeOfEightBytes = 0xC0;
constexpr std::string_view kMagic = "\x28\xB5\x2F\xFD";

using HashState = std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)>;

HashState make_content_hash() { return {XXH3_createState(), XXH3_freeState}; }

Hash128 content_hash(const HashState& state) {
  const XXH128_hash_t hash = XXH3_128bits_digest(state.get());
  return {hash.high64, hash.low64};
}

Error damaged_content(const std::string& path, std::string_view what) {
  return {Fault::kVerification, fmt::format("{}: {}", path, what)};
}

Error content_beyond(const std::string& path, std::uint64_t bytes) {
  return damaged_content(path, fmt::format("expands to more than {} bytes", bytes));
}

}  // namespace

struct ContentWriter::State {
  std::optional<File> file;  // nothing: the bytes go to `memory`
  Buffer<std::byte> memory;
  bool compresses = false;
  std::unique_ptr<ZSTD_CCtx, std::size_t (*)(ZSTD_CCtx*)> context{nullptr, ZSTD_freeCCtx};
  std::vector<std::byte> out;
  std::size_t filled = 0;  // of out
  HashState hash = make_content_hash();
  std::uint64_t content = 0, stored = 0;

  Status begin(bool compressed);
  Status write(std::span<const std::byte> bytes);
  std::uint64_t written() const { return file ? file->size() : memory.size(); }
  Status compress(std::span<const std::byte> bytes, ZSTD_EndDirective end);
  Status put();
  Status end_frame();
};

/// Writes what there is of the frame. Its first piece begins after a gap, so that its head has space for the content's size.
Status ContentWriter::State::put() {
  if (written() == 0) {
    std::memmove(out.data(), out.data() + kSizeBytes, kSizeOffset);
    out[kDescriptor] |= std::byte{kSizeOfEightBytes};
    std::memcpy(out.data() + kSizeOffset, &content, kSizeBytes);
  }
  return write(std::span(out.data(), std::exchange(filled, 0)));
}

Status ContentWriter::State::write(std::span<const std::byte> bytes) {
  if (file) return file->append(bytes);
  memory.insert(memory.end(), bytes.begin(), bytes.end());
  return {};
}

Status ContentWriter::State::compress(std::span<const std::byte> bytes, ZSTD_EndDirective end) {
  ZSTD_inBuffer in{bytes.data(), bytes.size(), 0};
  while (true) {
    ZSTD_outBuffer to{out.data(), out.size(), filled};
    const std::size_t left = ZSTD_compressStream2(context.get(), &to, &in, end);
    if (ZSTD_isError(left) != 0) return out_of_memory();  // the only way for valid parameters to fail
    filled = to.pos;
    if (end == ZSTD_e_end ? left == 0 : in.pos == in.size) return {};
    if (Status status = put(); !status) return status;
  }
}

Status ContentWriter::State::end_frame() {
  if (Status status = compress({}, ZSTD_e_end); !status) return status;
  const bool begun = written() > 0;
  const Status status = put();
  const auto size = std::as_bytes(std::span(&content, 1));
  if (!status || !begun) return status;
  if (file) return file->overwrite(kSizeOffset, size);
  std::ranges::copy(size, memory.begin() + kSizeOffset);
  return {};
}

ContentWriter::ContentWriter() : state_(std::make_unique<State>()) {}
ContentWriter::ContentWriter(ContentWriter&&) noexcept = default;
ContentWriter& ContentWriter::operator=(ContentWriter&&) noexcept = default;
ContentWriter::~ContentWriter() = default;

Status ContentWriter::open(const std::string& path, const FileOptions& options) {
  return begin(path, options, is_compressed(path));
}

Status ContentWriter::open_nowhere(bool compressed) { return begin("/dev/null", {.stream = true}, compressed); }

Status ContentWriter::open_in_memory(bool compressed) {
  state_->file.reset();
  state_->memory.clear();
  return state_->begin(compressed);
}

Status ContentWriter::begin(const std::string& path, const FileOptions& options, bool compressed) {
  State& state = *state_;
  FileOptions how = options;
  how.hash = false;
  state.file.reset();
  auto file = File::open(path, how);
  if (!file) return file.error();
  state.file.emplace(std::move(*file));
  return state.begin(compressed);
}

Status ContentWriter::State::begin(bool compressed) {
  content = 0;
  XXH3_128bits_reset(hash.get());
  compresses = compressed;
  if (!compresses) return {};
  filled = kSizeBytes;
  if (context) {
    ZSTD_CCtx_reset(context.get(), ZSTD_reset_session_only);
    return {};
  }
  context.reset(ZSTD_createCCtx());
  if (!context) return out_of_memory();
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, kLevel);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_windowLog, kWindowLog);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_contentSizeFlag, 0);
  out.resize(kContentPiece);
  return {};
}

Status ContentWriter::append(std::span<const std::byte> bytes) {
  State& state = *state_;
  state.content += bytes.size();
  while (!bytes.empty()) {
    const auto piece = bytes.first(std::min(bytes.size(), kCachedPiece));
    bytes = bytes.subspan(piece.size());
    XXH3_128bits_update(state.hash.get(), piece.data(), piece.size());
    const Status status = state.compresses ? state.compress(piece, ZSTD_e_continue) : state.write(piece);
    if (!status) return status;
  }
  return {};
}

Result<FileDigest> ContentWriter::finish() {
  State& state = *state_;
  if (state.compresses) {
    if (Status status = state.end_frame(); !status) return status.error();
  }
  state.stored = state.written();
  if (state.file) {
    const auto written = state.file->finish();
    state.file.reset();
    if (!written) return written.error();
  }
  return FileDigest{state.content, content_hash(state.hash)};
}

std::uint64_t ContentWriter::stored_bytes() const { return state_->stored; }

std::span<const std::byte> ContentWriter::stored() const { return state_->memory; }

std::uint64_t ContentWriter::bytes() const {
  return bytes_held(state_->memory) + state_->out.capacity() + (state_->context ? ZSTD_sizeof_CCtx(state_->context.get()) : 0);
}

Status write_content(const std::string& path, std::span<const std::byte> content, const FileOptions& options) {
  ContentWriter writer;
  Status status = writer.open(path, options);
  if (status) status = writer.append(content);
  if (!status) return status;
  const auto digest = writer.finish();
  return digest ? Status() : Status(digest.error());
}

namespace {

/// What has the frame's or the file's bytes.
class StoredReader {
 public:
  explicit StoredReader(FileReader& file) : file_(file), piece_(kContentPiece) {}

  /// The next bytes, empty at the end. errors  kVerification
  Result<std::span<const std::byte>> next() {
    const auto got = file_.read({reinterpret_cast<char*>(piece_.data()), piece_.size()});
    if (!got) return got.error();
    return std::span<const std::byte>(piece_.data(), *got);
  }

 private:
  FileReader& file_;
  std::vector<std::byte> piece_;
};

/// The size that the head of a frame states; nothing if it states none. errors  kVerification: no frame
Result<std::optional<std::uint64_t>> stated_size(const FileReader& file) {
  std::array<char, kMaxHead> head{};
  const std::size_t there = std::min<std::size_t>(head.size(), file.size());
  const bool read = file.read_at(0, std::span(head.data(), there));
  // libzstd also reads frames of its formats before RFC 8878, and skips frames without content.
  const bool begins = read && there >= kMagic.size() && std::ranges::equal(kMagic, std::span(head).first(kMagic.size()));
  const unsigned long long size = begins ? ZSTD_getFrameContentSize(head.data(), there) : ZSTD_CONTENTSIZE_ERROR;
  if (size == ZSTD_CONTENTSIZE_ERROR) return damaged_content(file.path(), "is no Zstandard frame");
  return size == ZSTD_CONTENTSIZE_UNKNOWN ? std::optional<std::uint64_t>() : std::optional<std::uint64_t>(size);
}

using Take = std::function<Status(std::span<const std::byte>)>;

class FrameReader {
 public:
  FrameReader(FileReader& file, std::uint64_t max_bytes, const Take& take)
      : file_(file), take_(take), max_(max_bytes), out_(kContentPiece) {}

  Status run() {
    const auto stated = stated_size(file_);
    if (!stated) return stated.error();
    if (stated->value_or(0) > max_) return content_beyond(file_.path(), max_);
    context_.reset(ZSTD_createDCtx());
    if (!context_) return out_of_memory();
    ZSTD_DCtx_setParameter(context_.get(), ZSTD_d_windowLogMax, kMaxWindowLog);
    StoredReader reader(file_);
    while (true) {
      const auto piece = reader.next();
      if (!piece) return piece.error();
      if (piece->empty()) break;
      if (ended_) return damaged_content(file_.path(), "has bytes after its frame");
      if (Status status = expand(*piece); !status) return status;
    }
    if (!ended_) return damaged_content(file_.path(), "ends within its frame");
    if (*stated && **stated != size_) return damaged_content(file_.path(), "has another size than its frame states");
    return {};
  }

 private:
  Status expand(std::span<const std::byte> piece) {
    ZSTD_inBuffer in{piece.data(), piece.size(), 0};
    bool full = true;  // more may wait in the decoder
    while (in.pos < in.size || full) {
      if (ended_) return in.pos < in.size ? Status(damaged_content(file_.path(), "has bytes after its frame")) : Status();
      ZSTD_outBuffer to{out_.data(), out_.size(), 0};
      const std::size_t left = ZSTD_decompressStream(context_.get(), &to, &in);
      if (ZSTD_isError(left) != 0)
        return damaged_content(file_.path(), fmt::format("its frame is damaged ({})", ZSTD_getErrorName(left)));
      full = to.pos == to.size;
      ended_ = left == 0;
      size_ += to.pos;
      if (size_ > max_) return content_beyond(file_.path(), max_);
      if (to.pos == 0) continue;
      if (Status status = take_(std::span<const std::byte>(out_.data(), to.pos)); !status) return status;
    }
    return {};
  }

  FileReader& file_;
  const Take& take_;
  std::uint64_t max_, size_ = 0;
  std::vector<std::byte> out_;
  std::unique_ptr<ZSTD_DCtx, std::size_t (*)(ZSTD_DCtx*)> context_{nullptr, ZSTD_freeDCtx};
  bool ended_ = false;
};

Result<FileReader> open_stored(const std::string& path) { return FileReader::open(path, {.missing = std::strerror(ENOENT)}); }

}  // namespace

Status expand_file(const std::string& path, std::uint64_t max_bytes, const Take& take) {
  auto file = open_stored(path);
  if (!file) return file.error();
  if (is_compressed(path)) return FrameReader(*file, max_bytes, take).run();
  if (file->size() > max_bytes) return damaged_content(path, fmt::format("has more than {} bytes", max_bytes));
  StoredReader reader(*file);
  while (true) {
    const auto piece = reader.next();
    if (!piece) return piece.error();
    if (piece->empty()) return {};
    if (Status status = take(*piece); !status) return status;
  }
}

Status read_content(const std::string& path, std::uint64_t max_bytes, std::string& content) {
  content.clear();
  return expand_file(path, max_bytes, [&](std::span<const std::byte> piece) {
    if (const std::size_t size = content.size() + piece.size(); size > content.capacity()) {
      // Never more than the maximum, where a string that grows by itself doubles.
      std::string larger;
      larger.reserve(std::min(static_cast<std::size_t>(max_bytes), std::max(size, 2 * content.capacity())));
      larger += content;
      content.swap(larger);
    }
    content.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    return Status();
  });
}

Result<std::string> read_content(const std::string& path, std::uint64_t max_bytes) {
  std::string content;
  if (Status status = read_content(path, max_bytes, content); !status) return status.error();
  return content;
}

Result<FileDigest> digest_content(const std::string& path, std::optional<std::uint64_t> expected) {
  if (!is_compressed(path)) return digest_file(path, expected);
  const auto file = open_stored(path);
  const auto stated = file ? stated_size(*file) : file.error();
  if (!stated) return stated.error();
  if (*stated && expected && **stated != *expected) return FileDigest{**stated, {}};
  const HashState state = make_content_hash();
  XXH3_128bits_reset(state.get());
  FileDigest digest;
  const Status status = expand_file(path, expected.value_or(kMaxTomlBytes), [&](std::span<const std::byte> piece) {
    digest.bytes += piece.size();
    XXH3_128bits_update(state.get(), piece.data(), piece.size());
    return Status();
  });
  if (!status) return status.error();
  digest.hash = content_hash(state);
  return digest;
}

std::string fault_of_stored(const std::string& path, std::uint64_t content_bytes) {
  const auto file = open_stored(path);
  if (!file) return file.error().message;
  const auto stated = stated_size(*file);
  if (!stated) return stated.error().message;
  if (stated->value_or(content_bytes) != content_bytes)
    return fmt::format("{}: {} bytes, the manifest says {}", path, **stated, content_bytes);
  auto stored = read_file(path, {.max_bytes = content_bytes + (content_bytes >> 8) + 1024});
  if (!stored) return stored.error().message;
  const std::size_t frame = ZSTD_findFrameCompressedSize(stored->data(), stored->size());
  if (ZSTD_isError(frame) != 0) return damaged_content(path, "ends within its frame").message;
  return frame == stored->size() ? std::string() : damaged_content(path, "has bytes after its frame").message;
}

}  // namespace lamina
