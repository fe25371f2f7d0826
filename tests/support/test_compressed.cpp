// Files of one Zstandard frame: what is written is read again, and no damaged, false or endless frame is believed.
#include <gtest/gtest.h>
#include <zstd.h>

#include <random>

#include "stages/support/io/compressed.h"
#include "tests/formats/images.h"

namespace lamina {
namespace {

/// Half noise, half repetition.
std::string content_of(std::size_t bytes) {
  std::mt19937 random(7);
  std::string content(bytes, '\0');
  for (std::size_t i = 0; i < bytes; ++i) content[i] = static_cast<char>(i / 4096 % 2 == 0 ? random() : i % 40);
  return content;
}

class Compressed : public ::testing::Test {
 protected:
  std::string name() const { return folder_ / "layer.planes.zst"; }
  void write(const std::string& content, std::size_t piece) const {
    ContentWriter writer;
    ASSERT_TRUE(writer.open(name(), {}).ok());
    for (std::size_t at = 0; at < content.size(); at += piece) {
      const std::string_view part = std::string_view(content).substr(at, piece);
      ASSERT_TRUE(writer.append(std::as_bytes(std::span(part))).ok());
    }
    const auto digest = writer.finish();
    ASSERT_TRUE(digest.ok());
    EXPECT_EQ(digest->bytes, content.size());
    EXPECT_EQ(digest->hash, hash_text(content));
    EXPECT_EQ(writer.stored_bytes(), formats::testing::load(name()).size());
    EXPECT_LE(writer.bytes(), ContentWriter::kMaxBytes);
  }
  /// What reading says of a changed file.
  std::string refusal(const std::string& stored, std::uint64_t max_bytes = 10'000'000) const {
    formats::testing::save(name(), std::as_bytes(std::span(stored)));
    const auto content = read_content(name(), max_bytes);
    if (content) return "read";
    EXPECT_EQ(content.error().fault, Fault::kVerification);
    EXPECT_TRUE(content.error().message.starts_with(name() + ": ")) << content.error().message;
    return content.error().message.substr(name().size() + 2);
  }
  formats::testing::Folder folder_;
};

TEST_F(Compressed, ContentsOfAnySizeAndPiecesAreTheSameFrame) {
  for (const std::size_t bytes : {0u, 1u, 100u, 128u << 10, 300'000u, 5'000'000u}) {
    const std::string content = content_of(bytes);
    std::string first;
    for (const std::size_t piece : {std::size_t{1} << 30, std::size_t{70'001}}) {
      write(content, piece);
      const std::string stored = formats::testing::load(name());
      if (first.empty()) first = stored;
      EXPECT_TRUE(stored == first) << "frames depend on how the content came";
      EXPECT_EQ(ZSTD_getFrameContentSize(stored.data(), stored.size()), bytes);
      const auto read = read_content(name(), bytes);
      ASSERT_TRUE(read.ok()) << read.error().message;
      EXPECT_TRUE(*read == content);
      EXPECT_LE(read->capacity(), std::max(bytes, std::string().capacity())) << "no more than the content";
      const auto digest = digest_content(name(), bytes);
      ASSERT_TRUE(digest.ok());
      EXPECT_EQ(digest->hash, hash_text(content));
      EXPECT_EQ(fault_of_stored(name(), bytes), "");
      std::string expanded(bytes + 1, '\0');
      EXPECT_EQ(ZSTD_decompress(expanded.data(), expanded.size(), stored.data(), stored.size()), bytes);
    }
  }
}

TEST_F(Compressed, PlainNamesArePlain) {
  ASSERT_TRUE(write_content(folder_ / "layer.gcode", std::as_bytes(std::span("G1", 2)), {}).ok());
  EXPECT_EQ(formats::testing::load(folder_ / "layer.gcode"), "G1");
  const auto content = read_content(folder_ / "layer.gcode", 2);
  ASSERT_TRUE(content.ok());
  EXPECT_EQ(*content, "G1");
  EXPECT_FALSE(read_content(folder_ / "layer.gcode", 1).ok());
}

TEST_F(Compressed, DamagedAndFalseFramesAreRefused) {
  const std::string content = content_of(400'000);
  write(content, 100'000);
  const std::string stored = formats::testing::load(name());
  EXPECT_EQ(refusal(stored), "read");
  EXPECT_EQ(refusal(""), "is no Zstandard frame");
  EXPECT_EQ(refusal("some text"), "is no Zstandard frame");
  // An empty frame of format 0.7, and one without content that is skipped (RFC 8878, section 3.1.2).
  EXPECT_EQ(refusal(std::string("\x27\xB5\x2F\xFD\0\1\x20\0\0", 9)), "is no Zstandard frame");
  EXPECT_EQ(refusal(std::string("\x50\x2A\x4D\x18\0\0\0\0", 8)), "is no Zstandard frame");
  for (const std::size_t left : {stored.size() - 1, stored.size() / 2, std::size_t{14}})
    EXPECT_EQ(refusal(stored.substr(0, left)), "ends within its frame") << left;
  EXPECT_EQ(refusal(stored + "x"), "has bytes after its frame");
  EXPECT_EQ(refusal(stored + stored), "has bytes after its frame") << "a second frame";
  for (const std::size_t at : {std::size_t{5000}, stored.size() - 2}) {
    std::string changed = stored;
    changed[at] ^= 4;
    // What still is a frame has another content, and so another hash.
    if (const std::string refused = refusal(changed); refused != "read") {
      EXPECT_TRUE(refused.starts_with("its frame is damaged")) << at;
    } else {
      EXPECT_NE(digest_content(name(), content.size())->hash, hash_text(content)) << at;
    }
  }
  // A head that states more or less than there is.
  for (const int by : {-1, 1}) {
    std::string changed = stored;
    changed[6] = static_cast<char>(changed[6] + by);
    EXPECT_NE(refusal(changed), "read");
    EXPECT_NE(fault_of_stored(name(), content.size()), "");
  }
  EXPECT_EQ(refusal(stored, content.size() - 1), "expands to more than 399999 bytes");
}

TEST_F(Compressed, FramesThatExpandWithoutEndOrNeedMuchMemoryAreRefused) {
  const std::string zeros(64 << 20, '\0');
  std::string bomb(ZSTD_compressBound(zeros.size()), '\0');
  const std::unique_ptr<ZSTD_CCtx, std::size_t (*)(ZSTD_CCtx*)> context(ZSTD_createCCtx(), ZSTD_freeCCtx);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_contentSizeFlag, 0);
  const auto made = [&] {
    return bomb.substr(0, ZSTD_compress2(context.get(), bomb.data(), bomb.size(), zeros.data(), zeros.size()));
  };
  EXPECT_EQ(refusal(made(), 1000), "expands to more than 1000 bytes");
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_windowLog, 27);
  EXPECT_TRUE(refusal(made(), zeros.size()).starts_with("its frame is damaged (Frame requires too much memory"));
}

}  // namespace
}  // namespace lamina
