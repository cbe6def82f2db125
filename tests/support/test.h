// What nearly every test needs of GoogleTest.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::testing::UnorderedElementsAre;

}  // namespace cairn
