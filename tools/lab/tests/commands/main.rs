//! Tests of the commands, each a process of its own.

#![cfg(test)]

mod channels;
mod contexts;
mod declared_faults;
mod import;
mod init;
mod model;
mod more_robots;
mod offline;
mod pomdp;
mod pomdp_compare;
mod pomdp_fit;
mod pomdp_learn;
mod pomdp_missions;
mod pomdp_solve;
mod report;
mod workplace;
mod your_robot;
