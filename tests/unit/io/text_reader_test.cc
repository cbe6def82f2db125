#include "io/text_reader.h"

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/rng.h"
#include "io/writers.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

TEST(TextReader, WordsLinesAndNumbers) {
  const TempFolder folder;
  WriteFileAtomically(folder / "a", "# comment\n\n  1\t+2.5 -3e-2\r\nlast line");
  TextReader reader(folder / "a");
  ASSERT_TRUE(reader.NextDataLine());
  EXPECT_EQ(reader.line_number(), 3);
  EXPECT_EQ(reader.Integer("n"), 1);
  EXPECT_THAT(reader.RemainingWords(), ElementsAre("+2.5", "-3e-2"));
  EXPECT_EQ(reader.Double("x"), 2.5);
  EXPECT_EQ(reader.Double("x"), -0.03);
  EXPECT_TRUE(reader.AtLineEnd());
  ASSERT_TRUE(reader.NextLine());
  EXPECT_EQ(reader.Rest(), "last line");
  EXPECT_FALSE(reader.NextLine());
}

// Windows' editors and spreadsheets begin UTF-8 with one.
TEST(TextReader, AByteOrderMarkIsNoPartOfTheText) {
  const TempFolder folder;
  WriteFileAtomically(folder / "a", "\xEF\xBB\xBFname\n\xEF\xBB\xBFsecond\n");
  TextReader reader(folder / "a");
  reader.NextLine();
  EXPECT_EQ(reader.line(), "name");
  reader.NextLine();
  EXPECT_EQ(reader.line(), "\xEF\xBB\xBFsecond");
}

TEST(TextReader, Utf16IsNamed) {
  const TempFolder folder;
  WriteFileAtomically(folder / "a", std::string("\xFF\xFE"
                                                "a\0",
                                                4));
  EXPECT_THAT(ThrownMessage<IoError>([&] { TextReader(folder / "a"); }), HasSubstr("is UTF-16"));
}

TEST(TextReader, WhatIsNoTextIsNamed) {
  const TempFolder folder;
  WriteFileAtomically(folder / "a", std::string("a\0b", 3));
  EXPECT_THAT(ThrownMessage<IoError>([&] { TextReader(folder / "a"); }),
              HasSubstr("is no text file"));
}

TEST(TextReader, ErrorsNameFileLineAndWord) {
  const TempFolder folder;
  WriteFileAtomically(folder / "a", "1\nx 1e999 9999999999999999999 inf\n");
  TextReader reader(folder / "a");
  reader.NextLine();
  reader.NextLine();
  const auto reason = [&](auto read) {
    try {
      read();
    } catch (const IoError& error) {
      EXPECT_EQ(error.path(), folder / "a:2");
      return error.reason();
    }
    return std::string("no error");
  };
  EXPECT_EQ(reason([&] { reader.Integer("count"); }), "count expected, not 'x'");
  EXPECT_EQ(reason([&] { reader.Double("x"); }), "x expected, not '1e999'");
  EXPECT_THAT(reason([&] { reader.Integer("id"); }), HasSubstr("id expected"));
  EXPECT_THAT(reason([&] { reader.Double("x"); }), HasSubstr("not 'inf'"));
  EXPECT_EQ(reason([&] { reader.Double("y"); }), "the line is too short: y is missing");
  EXPECT_EQ(reason([&] { reader.ExpectDataLine("the end"); }), "the file ends before the end");
}

TEST(TextWriter, NumbersReadBackExactly) {
  const TempFolder folder;
  Rng rng(1);
  std::vector<double> values = {0.0, -0.0, 1e-310, 1e300, 0.1, 123456789.0};
  for (int i = 0; i < 1000; ++i) {
    values.push_back(rng.Gaussian());
    values.back() *= std::pow(10, rng.Uniform(-20, 20));
  }
  TextWriter writer(folder / "a");
  writer << values << "\n" << 7 << " " << uint64_t{18446744073709551615u} << "\n";
  writer.Commit();
  TextReader reader(folder / "a");
  reader.NextLine();
  for (const double value : values) {
    const double read = reader.Double("value");
    EXPECT_EQ(read, value);
    EXPECT_EQ(std::signbit(read), std::signbit(value));
  }
  reader.NextLine();
  EXPECT_EQ(reader.Integer("n"), 7);
  EXPECT_EQ(reader.Word(), "18446744073709551615");
}

}  // namespace
}  // namespace cairn
