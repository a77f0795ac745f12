"""Laws that no list has: shapes without form first, then the shortest formula for one."""
