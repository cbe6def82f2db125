#include "base/hash.h"

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "cairn/base/error.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

// XXH3-64 with seed 0, from the reference implementation's documentation and `xxhsum -H3`.
TEST(Hash, KnownAnswers) {
  EXPECT_EQ(HashToHex(Hasher().Digest()), "2d06800538d394c2");
  EXPECT_EQ(HashToHex(Hasher().AddBytes("a", 1).Digest()), "e6c632b61e964e1f");
  EXPECT_EQ(HashToHex(Hasher().AddBytes("abc", 3).Digest()), "78af5f94892f3950");
  EXPECT_EQ(HashToHex(1), "0000000000000001");
}

TEST(Hash, PiecesAreOneStreamButTextsAreSeparated) {
  EXPECT_EQ(Hasher().AddBytes("ab", 2).AddBytes("c", 1).Digest(),
            Hasher().AddBytes("abc", 3).Digest());
  EXPECT_NE(Hasher().Add("ab").Add("c").Digest(), Hasher().Add("a").Add("bc").Digest());
  EXPECT_NE(Hasher().Add(int32_t{1}).Digest(), Hasher().Add(int64_t{1}).Digest());
}

TEST(Hash, FileHashIsThatOfItsBytes) {
  const TempFolder folder;
  const std::string path = folder / "file.bin";
  const std::string content(3'000'001, 'x');
  std::ofstream(path, std::ios::binary) << content;
  EXPECT_EQ(HashFile(path), Hasher().AddBytes(content.data(), content.size()).Digest());
  std::ofstream(path, std::ios::binary) << "";
  EXPECT_EQ(HashFile(path), Hasher().Digest());
  std::filesystem::remove(path);
  EXPECT_THROW(HashFile(path), IoError);
  EXPECT_THROW(HashFile(folder.path()), IoError);
}

}  // namespace
}  // namespace cairn
